A=/tmp/srch/a20_
R="${A}18.pkl:2:2 ${A}24.pkl:2:3 ${A}26.pkl:2:7 ${A}46.pkl:2:8 ${A}54.pkl:2:2 ${A}59.pkl:2:7"
F="${A}29.pkl:2:4 ${A}24.pkl:2:4 ${A}26.pkl:2:6 ${A}36.pkl:2:6 ${A}40.pkl:2:8 ${A}59.pkl:2:6"
for w in race cma samcon; do .venv/bin/python prototypes/ways.py $w 2.0 $R $F > /tmp/srch/ways_$w.log 2>&1; done
