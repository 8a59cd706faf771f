"""In-process spindle dynamics from ordinary stable cuts; tooltip FRFs and stability lobes of any tool."""

__version__ = "0.1.0"
