"""Studios for tests."""

from contextlib import contextmanager


@contextmanager
def running(content):
    """A studio on any free port."""
    from scengen.studio.app import Studio

    studio = Studio(content, "127.0.0.1", 0)
    try:
        yield studio
    finally:
        studio.close()
