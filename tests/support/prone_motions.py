"""Stored motions for a prone robot: one that gets it up, and one made for another start."""

RIGHT, WRONG = "prone_push_up_fast", "supine_sit_up_fast"
