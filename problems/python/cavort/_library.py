"""The library, its errors, and its memory as NumPy arrays."""

from __future__ import annotations

import os
from typing import Any, Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ._interface import ffi as ffi

Array = NDArray[np.float64]


class Error(Exception):
    """What the library refuses, in its own words: file, line, what was expected, what to do.

    status: in a word or two, such as "bad input" or "not finite". line: in the file, 0 where there is none.
    """

    def __init__(self, text: str, status: str, line: int = 0) -> None:
        super().__init__(text)
        self.status = status
        self.line = line


def _open() -> Any:
    # the package carries the library that its interface was made from
    path = os.path.join(os.path.dirname(__file__), "libcavort.so")
    try:
        return ffi.dlopen(path)
    except OSError as error:
        raise ImportError(f"{error}; a library that it needs is missing: see sh problems/install.sh build") from error


lib: Any = _open()


def text(pointer: Any) -> str:
    """A C string."""
    return str(ffi.string(pointer).decode("utf-8", "replace")) if pointer else ""


def new_error() -> Any:
    """A cav_error to be filled."""
    return ffi.new("cav_error *")


def failure(status: int, what: str = "", error: Any = None) -> Exception:
    """The exception for a status: the text of a cav_error, or what failed and the status in words."""
    name = text(lib.cav_status_name(status))
    told = text(error.text) if error is not None else ""
    if status == lib.CAV_NO_MEMORY:
        return MemoryError(told or what)
    return Error(told or (f"{what}: {name}" if what else name), name, error.line if error is not None else 0)


def check(status: int, what: str = "", error: Any = None) -> None:
    """Raises unless the status is that of success."""
    if status != lib.CAV_OK:
        raise failure(status, what, error)


def words(enumeration: str) -> dict[str, int]:
    """Enumerators of a C enumeration by their last words in lower case: {"euler": 0, ...}."""
    elements: dict[int, str] = ffi.typeof(enumeration).elements
    prefix = os.path.commonprefix(list(elements.values())).rpartition("_")[0]
    return {name[len(prefix) + 1 :].lower(): value for value, name in elements.items()}


def choose(enumeration: str, word: str, what: str) -> int:
    """The enumerator that a word stands for."""
    known = words(enumeration)
    if word not in known:
        raise ValueError(f"{what}: expected one of {', '.join(known)}, got {word!r}")
    return known[word]


def word(enumeration: str, value: int) -> str:
    """The word of an enumerator."""
    return next(name for name, other in words(enumeration).items() if other == value)


_FORMATS = {"double": "f8", "float": "f4", "int": "i4", "size_t": "u8"}
_dtypes: dict[str, np.dtype[Any]] = {}


def _format(ctype: Any) -> Any:
    # of a member, as np.dtype takes it; None: a pointer, which NumPy cannot hold
    if ctype.kind == "primitive":
        return _FORMATS[ctype.cname]
    if ctype.kind == "enum":
        return "i4"
    if ctype.kind == "struct":
        return struct_dtype(ctype)
    if ctype.kind == "array":
        if ctype.item.cname == "char":
            return f"S{ctype.length}"
        item = _format(ctype.item)
        return None if item is None else (item, (ctype.length,))
    return None


def struct_dtype(ctype: Any) -> np.dtype[Any]:
    """The NumPy type of a C struct, of the interface's own sizes and offsets; pointers are left out."""
    if ctype.cname not in _dtypes:
        fields = [(name, _format(field.type), field.offset) for name, field in ctype.fields]
        fields = [field for field in fields if field[1] is not None]
        _dtypes[ctype.cname] = np.dtype(
            {
                "names": [field[0] for field in fields],
                "formats": [field[1] for field in fields],
                "offsets": [field[2] for field in fields],
                "itemsize": ffi.sizeof(ctype),
            }
        )
    return _dtypes[ctype.cname]


class _Memory:
    """Memory of the library that NumPy looks at: keeps its owner alive as long as an array does."""

    def __init__(self, owner: Any, address: int, shape: Sequence[int], kind: str, writable: bool) -> None:
        self.owner = owner
        self.__array_interface__ = {
            "version": 3,
            "data": (address, not writable),
            "shape": tuple(shape),
            "typestr": kind,
        }


def view(owner: Any, pointer: Any, shape: Sequence[int], writable: bool = False) -> NDArray[Any]:
    """The memory at a pointer as an array, without a copy: of numbers, or of structs as a structured array."""
    item = ffi.typeof(pointer).item
    dtype = struct_dtype(item) if item.kind == "struct" else np.dtype(_FORMATS[item.cname])
    if not pointer or 0 in shape:
        return np.zeros(shape, dtype)
    address = int(ffi.cast("uintptr_t", pointer))
    kind = f"|V{dtype.itemsize}" if dtype.fields else dtype.str
    array: NDArray[Any] = np.asarray(_Memory(owner, address, shape, kind, writable))
    return array.view(dtype) if dtype.fields else array


def as_array(value: ArrayLike, shape: Sequence[int], what: str) -> Array:
    """Numbers of a caller as a contiguous array of doubles, of that shape."""
    array = np.ascontiguousarray(value, dtype=np.float64)
    if array.shape != tuple(shape):
        raise ValueError(f"{what} has the shape {array.shape}, expected {tuple(shape)}")
    return array


def pointer_to(array: Array) -> Any:
    """double * of a contiguous array, which keeps it alive."""
    return ffi.from_buffer("double[]", array)


def as_value(cdata: Any, ctype: Any) -> Any:
    """A member of a struct as Python has it."""
    if ctype.kind == "array" and ctype.item.cname == "char" or ctype.cname == "char *":
        return text(cdata)
    if ctype.kind == "array":
        return [as_value(cdata[i], ctype.item) for i in range(ctype.length)]
    if ctype.kind == "struct":
        return as_dict(cdata)
    return cdata


def as_dict(struct: Any) -> dict[str, Any]:
    """The members of a struct by name, without pointers other than to text."""
    ctype = ffi.typeof(struct)
    ctype = ctype.item if ctype.kind == "pointer" else ctype
    return {
        name: as_value(getattr(struct, name), field.type)
        for name, field in ctype.fields
        if field.type.kind != "pointer" or field.type.cname == "char *"
    }


class Record(dict[str, Any]):
    """A dict whose items are attributes, too."""

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"no {name!r}; there are {', '.join(self)}") from None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({', '.join(f'{name}={value!r}' for name, value in self.items())})"


def record(struct: Any, flags: Sequence[str] = ()) -> Record:
    """The members of a struct; flags are those that are true or false."""
    values = as_dict(struct)
    return Record({name: bool(value) if name in flags else value for name, value in values.items()})


class Options:
    """Options of the library as attributes: numbers, flags and words ("euler"), checked as they are set.

    dir() and repr() list them; as_dict() gives them all, update() sets several. Their meaning: include/cavort/model.h
    (CAV_OPTIONS, of the contact law) and problem.h (CAV_STAGE_OPTIONS, of a stage).
    """

    __slots__ = ("_struct", "_fields", "_owner", "_what")
    _fields: dict[str, Any]

    def __init__(self, struct: Any, table: Callable[[Any], Any], what: str, owner: Any = None) -> None:
        count = ffi.new("int *")
        field = table(count)
        set_own = object.__setattr__
        set_own(self, "_struct", struct)
        set_own(self, "_fields", {text(field[i].name): field[i] for i in range(count[0])})
        set_own(self, "_owner", owner)
        set_own(self, "_what", what)

    def __getattr__(self, name: str) -> Any:
        if name.startswith("_") or name not in self._fields:
            raise AttributeError(f"no option {name!r}; there are {', '.join(self._fields)}")
        field, value = self._fields[name], getattr(self._struct, name)
        if field.type == lib.CAV_FIELD_WORD:
            return text(field.words[int(value)])
        return bool(value) if field.type == lib.CAV_FIELD_FLAG else value

    def __setattr__(self, name: str, value: Any) -> None:
        if name not in self._fields:
            raise AttributeError(f"no option {name!r}; there are {', '.join(self._fields)}")
        field, before = self._fields[name], getattr(self._struct, name)
        if field.type == lib.CAV_FIELD_WORD:
            known = self._words(field)
            if value not in known:
                raise ValueError(f"{name}: expected one of {', '.join(known)}, got {value!r}")
            value = known.index(value)
        setattr(self._struct, name, value)
        error, table = new_error(), ffi.new("cav_field[1]", [field])
        if lib.cav_fields_check(table, 1, self._struct, self._what.encode(), error):
            setattr(self._struct, name, before)
            raise ValueError(text(error.text))

    @staticmethod
    def _words(field: Any) -> list[str]:
        known: list[str] = []
        while field.words[len(known)]:
            known.append(text(field.words[len(known)]))
        return known

    def as_dict(self) -> dict[str, Any]:
        """All options by name."""
        return {name: getattr(self, name) for name in self._fields}

    def update(self, **options: Any) -> "Options":
        """Sets several; returns itself."""
        for name, value in options.items():
            setattr(self, name, value)
        return self

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *self._fields]

    def __repr__(self) -> str:
        return f"Options({', '.join(f'{name}={value!r}' for name, value in self.as_dict().items())})"


def contact_options(struct: Any, owner: Any = None) -> Options:
    """A cav_options as Options."""
    return Options(struct, lib.cav_option_fields, "the contact law", owner)
