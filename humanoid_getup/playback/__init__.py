"""Playback of motions and policies: preflight, playing, supervision."""
