"""Lets Debian's ParaView 5.11 load plug-ins in Python: it asks for a function that its Python 3.11 no longer has.

Put this folder on PYTHONPATH. ParaView as its makers ship it does not need it.
"""

import inspect

if not hasattr(inspect, "getargspec"):
    inspect.getargspec = inspect.getfullargspec
