# SPDX-License-Identifier: Apache-2.0
"""What editors and type checkers know of `import palpate`: python3 -m palpate._stubs __init__.pyi.

Classes come from the library's table of fields, functions from themselves, so that nothing has to be kept in step by hand.
"""
import inspect
import re
import sys

import palpate
from palpate import _palpate

HEAD = '''# Made by palpate/_stubs.py of the built module.
from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, Optional

from numpy.typing import ArrayLike, NDArray

'''
OF_DEFAULT = {bool: "bool", int: "int", float: "float", str: "str", tuple: "ArrayLike"}
ARRAY = r"numpy\.ndarray, [\w ]+"  # with its shape


def held(kind):
    """The type of what a field gives."""
    return re.sub(ARRAY, "NDArray[Any]", kind)


def taken(kind):
    """The type of what a field may be made of: anything that numpy takes, any sequence."""
    return re.sub(ARRAY, "ArrayLike", kind).replace("list[", "Sequence[")


def documented(thing, indent):
    words = inspect.getdoc(thing) or ""
    lines = "\n".join((indent + line).rstrip() for line in words.replace("\\", "\\\\").splitlines())
    return f'{indent}"""{lines.lstrip()}"""\n' if words else ""


def annotated(one):
    """An argument says its type, or its default does."""
    if one.annotation is not one.empty or one.name == "self":
        return one
    return one.replace(annotation=OF_DEFAULT.get(type(one.default), "Any"))


def function(name, made, indent=""):
    signature = inspect.signature(made)
    signature = signature.replace(parameters=[annotated(one) for one in signature.parameters.values()])
    return f"{indent}def {name}{signature}:\n{documented(made, indent + '    ')}{indent}    ...\n"


def members(of):
    """Methods, properties and plain values that a class itself holds."""
    text = ""
    for name, one in vars(of).items():
        if name.startswith("_") and name != "__init__":
            continue
        if isinstance(one, property):
            text += "    @property\n" + function(name, one.fget, "    ")
        elif inspect.isfunction(one):
            text += function(name, one, "    ")
        else:
            text += f"    {name}: {type(one).__name__}\n"
    return text


def noun(name, fields):
    made = getattr(palpate, name)
    given = "".join(f", {field}: {taken(kind)} = ..." for field, kind, _, _ in fields)
    text = f"class {name}:\n{documented(made, '    ')}" + "".join(f"    {field}: {held(kind)}\n" for field, kind, _, _ in fields)
    text += f"    def __init__(self, *{given}) -> None: ...\n"
    return text + "".join(members(base) for base in made.__mro__[1:-1])


def stubs():
    nouns = {name: fields for name, _, fields, _ in _palpate.nouns()}
    text = HEAD + "__version__: str\n\n"
    for name in palpate.__all__:
        one = getattr(palpate, name)
        if name in nouns:
            text += noun(name, nouns[name])
        elif one is palpate.Error:
            text += f"class Error(ValueError):\n{documented(one, '    ')}    where: str\n    message: str\n"
        elif inspect.isclass(one):
            text += f"class {name}:\n{documented(one, '    ')}{members(one)}"
        else:
            text += function(name, one)
        text += "\n"
    return text


if __name__ == "__main__":
    with open(sys.argv[1], "w", encoding="utf-8") as file:
        file.write(stubs())
