cd /work/wt/search; export PYTHONPATH=$PWD
A=/tmp/srch/a20_
S="${A}18.pkl:2:2 ${A}46.pkl:2:8 ${A}36.pkl:2:6 ${A}40.pkl:2:8 ${A}24.pkl:2:4 ${A}59.pkl:2:6"
.venv/bin/python prototypes/eval_search.py 2.0 1500 1 "" $S > /tmp/srch/abl_es.log 2>&1
.venv/bin/python prototypes/eval_search.py 2.0 800 1 "UNIT_OFFSET=0" $S > /tmp/srch/abl_tempo.log 2>&1
.venv/bin/python prototypes/eval_search.py 2.0 800 1 "UNIT_TEMPO=0" $S > /tmp/srch/abl_offset.log 2>&1
