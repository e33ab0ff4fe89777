cd /work/wt/search; export PYTHONPATH=$PWD
A=/tmp/srch/a20_
S="${A}18.pkl:2:2 ${A}46.pkl:2:8 ${A}26.pkl:2:6"
.venv/bin/python prototypes/eval_search.py 2.0 600 1 "UNIT_OFFSET=0" $S > /tmp/srch/abl_tempo.log 2>&1
.venv/bin/python prototypes/eval_search.py 2.0 600 1 "UNIT_TEMPO=0" $S > /tmp/srch/abl_offset.log 2>&1
.venv/bin/python prototypes/eval_search.py 2.0 600 1 "" ${A}26.pkl:2:6 ${A}24.pkl:2:3 ${A}26.pkl:2:7 ${A}54.pkl:2:2 ${A}59.pkl:2:7 ${A}59.pkl:2:6 > /tmp/srch/abl_es2.log 2>&1
