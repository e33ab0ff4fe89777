"""Boards: plots that stand upright in the scene, whose points are dragged or clicked."""
