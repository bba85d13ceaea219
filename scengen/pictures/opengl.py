"""Contexts of OpenGL that any thread can use in turn, and that are freed before OpenGL ends with the process.

A context is current in one thread at most. It is made current for each picture and released afterwards, so that the
next picture may be taken in another thread, and so that no context receives the commands of another one.
"""

import atexit
import ctypes
import os
import sys
import weakref
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache, cached_property, partial
from importlib import import_module
from typing import Any

import mujoco
import numpy as np
from mujoco import MjModel, gl_context

from ..errors import BadConfig, ScengenError, cut

LARGEST_EDGE = 4096
"""Largest width and height of a picture [pixels], which OpenGL supports on all machines."""

_open_renderers: "weakref.WeakSet[Renderer]" = weakref.WeakSet()
"""Renderers that are to be closed at the end of the process."""


class Forked(ScengenError):
    """A process was forked after a picture was taken."""


def check_process() -> None:
    """Raise `Forked` in a process that was forked from one with OpenGL: without its threads a picture never ends."""
    if _forked:
        why = "this process was forked from one that has taken a picture, and OpenGL has only half survived that"
        raise Forked(f'{why}; start processes with spawn: multiprocessing.get_context("spawn"), context="spawn"')


_forked = False
"""Whether this process was forked from one that had OpenGL."""


def _leave_to_the_parent() -> None:
    """Leave the renderers of the process that was forked alone: to free them here would wait for its threads."""
    global _forked
    if _forked or not _close_at_exit.cache_info().currsize:
        return
    _forked, sys.excepthook = True, partial(_end_at_once, sys.excepthook)
    for renderer in list(_open_renderers):
        for part in (renderer._gl_context, renderer._mjr_context):
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(part))
        renderer._gl_context = renderer._mjr_context = None
    _open_renderers.clear()
    if backend := sys.modules.get("mujoco.egl"):
        atexit.unregister(backend.EGL.eglTerminate)


def _end_at_once(hook: Any, *error: Any) -> None:
    """Show the error that ends a forked process, and end it: the handlers of OpenGL would wait for missing threads."""
    hook(*error)
    for stream in (sys.stdout, sys.stderr):
        stream.flush()
    os._exit(1)


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_leave_to_the_parent)


def has_display() -> bool:
    """Whether MuJoCo's contexts need no display, or have one: only those of GLFW need one, and only on Linux.

    MuJoCo reads `MUJOCO_GL` when it is imported, possibly before scengen has set it or the user has. Without a display
    its contexts are then exchanged for those that the variable names now.
    """
    if "glfw" not in gl_context.GLContext.__module__ or sys.platform != "linux" or os.environ.get("DISPLAY"):
        return True
    backend = os.environ.get("MUJOCO_GL", "").lower().strip()
    if backend not in WITHOUT_DISPLAY:
        return False
    try:
        gl_context.GLContext = import_module(f"mujoco.{backend}").GLContext
    except Exception:  # the type of the error for a missing library depends on the back end
        return False
    return True


WITHOUT_DISPLAY = ("egl", "osmesa")
"""Values of `MUJOCO_GL` that need no display, and modules of MuJoCo."""


def check_size(**edges: int) -> None:
    """Raise `BadConfig` unless pictures can have this width and height. `edges` has the names of the arguments."""
    for name, value in edges.items():
        whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
        if not whole or not 1 <= value <= LARGEST_EDGE:
            accepted = f"it must be a whole number of pixels from 1 to {LARGEST_EDGE}"
            raise BadConfig(f"{name} = {cut(repr(value))}; {accepted}")


@contextmanager
def current(context: Any) -> Iterator[None]:
    """Make a context of MuJoCo or robosuite current in this thread during a `with` statement."""
    context.make_current()
    try:
        yield
    finally:
        release(context)


def release(context: Any) -> None:
    """Let no context be current in this thread. `context` determines the back end: EGL, OSMesa or GLFW."""
    for kind in type(context).__mro__:
        backend: Any = sys.modules[kind.__module__]
        if hasattr(backend, "EGL_DISPLAY"):
            egl = backend.EGL
            egl.eglMakeCurrent(backend.EGL_DISPLAY, egl.EGL_NO_SURFACE, egl.EGL_NO_SURFACE, egl.EGL_NO_CONTEXT)
        elif hasattr(backend, "osmesa"):
            backend.osmesa.OSMesaMakeCurrent(None, None, backend.GL.GL_FLOAT, 0, 0)
        elif hasattr(backend, "glfw"):
            backend.glfw.make_context_current(None)


class Renderer(mujoco.Renderer):
    """MuJoCo's renderer for any thread. Two threads must not use it at the same time."""

    _gl_context: Any = None  # `close` reads both, even if `__init__` has failed before it has set them
    _mjr_context: Any = None

    def __init__(self, model: MjModel, height: int, width: int, smooth_shadows: bool = False):
        """Make a context, with buffers that are large enough for the picture.

        Args:
            smooth_shadows: compute shadows and textures for each sample of a pixel, as MuJoCo computes edges. OpenGL
                before version 4 cannot do it.

        Raises:
            Forked: this process was forked from one with OpenGL.
            Exception: OpenGL is missing. The type depends on platform and back end.
        """
        check_process()
        buffers = model.vis.global_
        buffers.offwidth, buffers.offheight = max(buffers.offwidth, width), max(buffers.offheight, height)
        super().__init__(model, height, width)
        if smooth_shadows:
            _shade_samples()
        self._release()
        _close_at_exit()
        _open_renderers.add(self)

    @cached_property
    def device(self) -> str:
        """Name of the renderer: of a graphics card, or of a program with its version."""
        from OpenGL import GL  # only here: it chooses its back end when it is imported

        with current(self._gl_context):
            return bytes(GL.glGetString(GL.GL_RENDERER) or b"").decode()

    def render(self, *, out: Any = None) -> Any:
        check_process()
        try:
            return super().render(out=out)
        finally:
            self._release()

    def refresh(self) -> None:
        """Upload all textures again."""
        with current(self._gl_context):
            for texture in range(self.model.ntex):
                mujoco.mjr_uploadTexture(self.model, self._mjr_context, texture)

    def close(self) -> None:
        """Free the textures while their own context is current, because contexts number alike; then the context."""
        _open_renderers.discard(self)
        context, self._gl_context = self._gl_context, None
        drawn, self._mjr_context = self._mjr_context, None
        try:
            if context:
                context.make_current()
            if drawn:
                drawn.free()
            if context:
                context.free()
        except Exception:
            if context and _ending:
                context._context = None  # robosuite's handler has ended OpenGL already, so that nothing is left to free
                return
            raise

    def _release(self) -> None:
        if self._gl_context:
            release(self._gl_context)


def _shade_samples() -> None:
    """Let the current context compute the colour of each sample of a pixel, where it can."""
    from OpenGL import GL  # here, because MuJoCo chooses its platform

    if GL.glGetIntegerv(GL.GL_MAJOR_VERSION) >= SAMPLE_SHADING:
        GL.glEnable(GL.GL_SAMPLE_SHADING)
        GL.glMinSampleShading(1.0)


SAMPLE_SHADING = 4
"""First version of OpenGL that can shade samples."""

_ending = False
"""Whether the process is ending."""


@cache
def _close_at_exit() -> None:
    """Register `_close_all`, after the first context: handlers run in reverse order, and its own one ends OpenGL."""
    atexit.register(_close_all)


def _close_all() -> None:
    """Close the renderers that are still open. After the end of OpenGL they could not be freed without an error."""
    global _ending
    _ending = True
    for renderer in list(_open_renderers):
        renderer.close()
