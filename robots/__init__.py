"""Robot descriptions: one folder a robot, and the types that load it.

Each name is imported when it is first used.
"""

from robots.lazy_names import attach_stub

__getattr__, __dir__, __all__ = attach_stub(__name__, __file__)
