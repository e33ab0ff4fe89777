"""Physics: a robot compiled into a scene, worlds stepped side by side, where there is room."""
