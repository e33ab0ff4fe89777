cd /work/wt/search; export PYTHONPATH=$PWD
A=/tmp/srch/a20_
while kill -0 9771 2>/dev/null; do sleep 1; done
.venv/bin/python prototypes/ways.py samcon 2.0 ${A}18.pkl:2:2 ${A}26.pkl:2:7 ${A}26.pkl:2:6 ${A}24.pkl:2:4 ${A}59.pkl:2:7 ${A}40.pkl:2:8 > /tmp/srch/ways_samcon.log 2>&1
