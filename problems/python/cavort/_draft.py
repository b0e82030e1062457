"""A model in the making."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._library import failure, ffi, lib, new_error, pointer_to, text
from ._model import Model, load_options


class Element:
    """An element of a draft: add() puts others into it, set() gives it attributes."""

    def __init__(self, draft: "Draft", number: int) -> None:
        self._draft = draft
        self._number = number

    def add(self, element: str, **attributes: Any) -> "Element":
        """Puts an element of MJCF into this one (body, joint, freejoint, geom, site, motor, ...), after those that it has."""
        made = Element(self._draft, lib.cav_draft_add(self._draft._c, self._number, element.encode()))
        return made.set(**attributes)

    def set(self, **attributes: Any) -> "Element":
        """Attributes as in MJCF: texts, flags, numbers or arrays of them; class_ stands for class. Returns itself."""
        for name, value in attributes.items():
            name = name.rstrip("_")
            if isinstance(value, bool):
                value = "true" if value else "false"
            if isinstance(value, str):
                lib.cav_draft_text(self._draft._c, self._number, name.encode(), value.encode())
            else:
                numbers = np.atleast_1d(np.asarray(value, dtype=np.float64)).reshape(-1)
                array = pointer_to(np.ascontiguousarray(numbers))
                lib.cav_draft_numbers(self._draft._c, self._number, name.encode(), array, len(numbers))
        return self


class Draft:
    """A model made element by element, in MJCF's elements and attributes; angles in radians.

    world holds bodies, root the sections (actuator, tendon, sensor, ...). What is wrong is told by compile().
    """

    def __init__(self, name: str = "model") -> None:
        pointer = lib.cav_draft_new(name.encode())
        if not pointer:
            raise MemoryError("no memory for a draft")
        self._c = ffi.gc(pointer, lib.cav_draft_free)
        self.root = Element(self, lib.CAV_DRAFT_ROOT)
        self.world = Element(self, lib.CAV_DRAFT_WORLD)

    @property
    def mjcf(self) -> str:
        """The draft as MJCF, which a file may hold; "" after a failure."""
        return text(lib.cav_draft_mjcf(self._c))

    def compile(self, folder: str = ".", *, overlaps: bool = False) -> Model:
        """The model; files that it names are sought from folder."""
        error = new_error()
        options = load_options(False, overlaps)
        pointer = lib.cav_draft_compile(self._c, str(folder).encode(), options, error)
        if not pointer:
            raise failure(error.status, "the model", error)
        model = Model.__new__(Model)
        model._take(ffi.gc(pointer, lib.cav_model_free), None)
        return model
