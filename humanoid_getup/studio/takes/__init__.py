"""Takes: what the timeline can scrub through, and how results become one."""
