"""Physics: a robot compiled into a scene, one or many at a time."""
