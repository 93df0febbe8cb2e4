"""Copies a virtual world in the middle of its run, so that what many trials have in common runs once.

Python's own deep copy is right for plain objects. It would tear views from the arrays that they look into,
and it knows neither MuJoCo's memory nor VQF's. These are copied first; the deep copy finds them done.
"""

from __future__ import annotations

import copy
import gc
from collections.abc import Iterator
from types import BuiltinFunctionType, FunctionType, ModuleType
from typing import TYPE_CHECKING, TypeVar, cast

import mujoco
import numpy as np
from pydantic import BaseModel

from common.quaternion import Array
from common.skeleton import Skeleton

if TYPE_CHECKING:
    from vqf import VQF  # not on every platform

T = TypeVar("T")
_SHARED = (Skeleton, BaseModel)
"""Nobody changes these: the copy refers to the same ones, and caches know them."""
_LEAVES = (type, ModuleType, FunctionType, BuiltinFunctionType, *_SHARED)
_MUJOCO = (mujoco.MjModel, mujoco.MjData)
_PROPERTIES = {
    kind: [name for name, value in vars(kind).items() if isinstance(value, property)] for kind in _MUJOCO
}


def copied(root: T) -> T:
    """A copy that goes on exactly as `root` would, and shares nothing with it that either changes.

    Raises TypeError where it meets what deep copies share: a function that refers to variables around it, a
    built-in object's bound method, or an array in memory that it does not know.
    """
    found = list(_reachable(root))
    memo: dict[int, object] = {id(each): each for each in found if isinstance(each, _SHARED)}
    blocks: list[tuple[int, Array, Array]] = []
    for each in found:
        if isinstance(each, _MUJOCO):
            memo[id(each)] = twin = copy.copy(each)
            blocks += [
                (part.ctypes.data, part, getattr(twin, name)) for name, part in _parts(each) if part.nbytes
            ]
        elif type(each).__name__ == "VQF":
            memo[id(each)] = _copied_vqf(cast("VQF", each))
    owners: dict[int, Array] = {}
    for each in found:
        if isinstance(each, np.ndarray) and not each.dtype.hasobject:
            memo[id(each)] = _copied_array(each, owners, blocks)
    return copy.deepcopy(root, memo)


def _reachable(root: object) -> Iterator[object]:
    seen, waiting = {id(root)}, [root]
    while waiting:
        each = waiting.pop()
        yield each
        if isinstance(each, FunctionType) and each.__closure__:
            raise TypeError(f"{each.__qualname__} refers to variables around it: use functools.partial")
        if isinstance(each, BuiltinFunctionType) and not isinstance(each.__self__, (ModuleType, type)):
            raise TypeError(f"{each.__qualname__} changes what would not be copied with it: use a method")
        if isinstance(each, _LEAVES):
            continue
        # an array's base is no referent of it in the eyes of the garbage collector
        below = [each.base] if isinstance(each, np.ndarray) else gc.get_referents(each)
        fresh = {id(one): one for one in below if id(one) not in seen}
        seen.update(fresh)
        waiting += fresh.values()


def _parts(of: object) -> Iterator[tuple[str, Array]]:
    for name in _PROPERTIES[type(of)]:
        part = getattr(of, name)
        if isinstance(part, np.ndarray):
            yield name, part


def _copied_array(array: Array, owners: dict[int, Array], blocks: list[tuple[int, Array, Array]]) -> Array:
    """The same window into the copy of the memory that the array looks into."""
    owner = array
    while isinstance(owner.base, np.ndarray):
        owner = owner.base
    if owner.base is None:
        if id(owner) not in owners:
            owners[id(owner)] = owner.copy(order="K")
        twin = owners[id(owner)]
        return twin if owner is array else _window(array, owner, twin)
    at = array.ctypes.data
    for begin, part, twin in blocks:
        if begin <= at < begin + part.nbytes:
            return _window(array, part, twin)
    if array.flags.writeable:
        raise TypeError(f"an array of {array.shape} looks into memory of a {type(owner.base).__name__}")
    return array


def _window(array: Array, owner: Array, twin: Array) -> Array:
    offset = array.ctypes.data - owner.ctypes.data
    flat = twin.reshape(-1, order="A") if twin.flags.forc else None
    if flat is None:
        raise TypeError(f"an array of {array.shape} looks into one with gaps")
    view = np.ndarray(array.shape, array.dtype, flat.data, offset, array.strides)
    view.flags.writeable = array.flags.writeable
    return view


def _copied_vqf(vqf: VQF) -> VQF:
    twin = type(vqf)(float(vqf.coeffs["gyrTs"]), **vqf.params)
    twin.state = vqf.state
    return twin
