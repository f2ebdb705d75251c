# SPDX-License-Identifier: Apache-2.0
"""The classes of data, made of the library's own table of fields."""
from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING

import numpy

from palpate import _palpate

if TYPE_CHECKING:
    from palpate import Parameter


def _short(value):
    if isinstance(value, numpy.ndarray):
        return repr(value) if value.size <= 4 else "array(" + " x ".join(map(str, value.shape)) + ")"
    if isinstance(value, (list, tuple)) and len(value) > 3:
        return f"[{len(value)} of {type(value[0]).__name__}]"
    return repr(value)


class _Noun:
    __slots__ = ()

    def __repr__(self):
        return type(self).__name__ + "(" + ", ".join(f"{f.name}={_short(getattr(self, f.name))}" for f in dataclasses.fields(self)) + ")"


class _Identification(_Noun):
    __slots__ = ()

    def parameter(self, name: str, region: str = "") -> Parameter:
        """The parameter of that name. KeyError lists those that there are."""
        for one in self.parameters:
            if one.name == name and one.region == region:
                return one
        there = ", ".join(one.name + (f" of {one.region!r}" if one.region else "") for one in self.parameters)
        raise KeyError(f"{name!r}{f' of {region!r}' if region else ''}; there are: {there or 'none'}")

    @property
    def young_modulus(self) -> Parameter:
        """Of the whole object, Pa. Of one in regions: parameter('young_modulus', region)."""
        return self.parameter("young_modulus")

    @property
    def poisson_ratio(self) -> Parameter:
        return self.parameter("poisson_ratio")


class _Load(_Noun):
    __slots__ = ()

    def __post_init__(self):
        """As in a file: a direction that is not given is that of the force."""
        if self.direction is None:
            try:
                force_n = numpy.asarray(self.force_n, float)
            except (TypeError, ValueError):  # said by its place when the recording is used
                force_n = numpy.zeros(3)
            length = numpy.linalg.norm(force_n) if force_n.shape == (3,) else 0.0
            self.direction = force_n / length if length > 0 else numpy.array([0.0, 0.0, -1.0])


_bases = {"Identification": _Identification, "Load": _Load}
_not_given = {("Load", "direction")}


def _made(name, about, fields):
    made = dataclasses.make_dataclass(name, [(field, kind, dataclasses.field(default_factory=(lambda: None) if (name, field) in _not_given else default))
                                             for field, kind, _, default in fields],
                                      bases=(_bases.get(name, _Noun),), kw_only=True, slots=True, eq=False, repr=False)
    made.__module__ = "palpate"
    made.__doc__ = about + "\n\n" + "".join(f"    {field}: {kind}" + (f"\n        {words}" if words else "") + "\n"
                                           for field, kind, words, _ in fields)
    return made


def classes():
    """{name: class} of every noun; tells the extension of them."""
    out = {}
    for name, about, fields, take in _palpate.nouns():
        out[name] = _made(name, about, fields)
        take(out[name])
    return out
