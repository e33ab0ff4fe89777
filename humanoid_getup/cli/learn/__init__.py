"""Commands of policies: `train`, `eval`, `export` and `prior`."""
