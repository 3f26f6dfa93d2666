"""Mutations of functions and macros, and how one is made in all processes of a test run.

With `CLTRACE_MUTATION=NAME PYTHONPATH=tests/mutating:tests`, Python makes the mutation of that name, of
tests/mutations.py, when a process starts: that of pytest, a worker of xdist, or a command that a test runs.
"""

from __future__ import annotations

import importlib
import inspect
import os
import re
import sys
import traceback
from collections.abc import Callable
from functools import partial
from types import FunctionType
from typing import Any, NamedTuple

VARIABLE = "CLTRACE_MUTATION"
# The status of a process in which the mutation could not be made, or the mutated program does not build.
NOT_MUTATED = 9


class Python(NamedTuple):
    """A function, method or constant of the package that behaves otherwise.

    Attributes
    ----------
    target
        "module:name" or "module:Class.method", without the package's name.
    change
        Called in place of a function, with the original one and its arguments, or with the original constant.
    tests
        Arguments of pytest, separated by spaces: the tests that should fail.
    """

    target: str
    change: Callable[..., Any]
    tests: str

    def _place(self) -> tuple[Any, str]:
        module, path = self.target.split(":")
        *classes, name = path.split(".")
        place: Any = importlib.import_module(f"cltrace.{module}")
        for class_ in classes:
            place = getattr(place, class_)
        return place, name

    def is_found(self) -> bool:
        place, name = self._place()
        return name in vars(place)

    def make(self) -> None:
        place, name = self._place()
        replace(place, name, self.change)


class Kernel(NamedTuple):
    """A function or a macro of the kernels that behaves otherwise.

    Attributes
    ----------
    name
        The function or macro.
    body
        The body of the function that is called in its place, with the same parameters, which may be changed. CALL
        stands for the call of the original function with them. Of a macro, what replaces it.
    tests
        Arguments of pytest, separated by spaces: the tests that should fail.
    """

    name: str
    body: str
    tests: str

    def is_found(self) -> bool:
        from cltrace.run import program, rays
        from cltrace.run.pack import toolbox

        programs = program.SOURCES, program.UNSTOPPABLE, rays.FILES, toolbox.FILES
        return any(self.applied(text) != text for text in map(program.source, programs))

    def make(self) -> None:
        from cltrace.run import program

        replace(program, "source", lambda original, *files: self.applied(original(*files)))
        replace(program, "program", _built)

    def applied(self, text: str) -> str:
        """The text of a program with the mutation, the same text if the program does not have the target."""
        function = re.compile(
            rf"^(?P<type>\w[^\n{{}};]*?)\b{self.name}\((?P<parameters>[^{{}};]*)\) {{\n.*?^}}\n",
            re.MULTILINE | re.DOTALL,
        )
        mutated = function.sub(self._wrapped, text)
        if mutated != text:
            return mutated
        macro = re.compile(rf"^#define {self.name}\b(?:\\\n|.)*\n", re.MULTILINE)
        return macro.sub(lambda found: f"{found[0]}#undef {self.name}\n#define {self.name} {self.body}\n", text)

    def _wrapped(self, found: re.Match[str]) -> str:
        """A definition, and after it the function that all later calls of that name go to."""
        type_ = re.sub(r"__attribute__\(\(\w+\)\) ", "", found["type"])
        names = ", ".join(re.findall(r"(\w+)\s*(?:,|$)", found["parameters"]))
        variables = re.sub(r"\bconst (?=\w+ \w+\s*(?:,|$))", "", found["parameters"])
        body = self.body.replace("CALL", f"{self.name}({names})")
        wrapper = f"{type_}mutated({variables}) {{ {body} }}\n#define {self.name}(...) mutated(__VA_ARGS__)\n"
        return found[0] + wrapper


def replace(place: Any, name: str, change: Callable[..., Any]) -> None:
    """Replaces what a module or a class has by this name.

    A function gets other code and stays the same object, so that every reference to it is mutated: in modules that have
    imported it, in tables, in bound methods and in caches.
    """
    found = inspect.getattr_static(place, name)
    function = inspect.unwrap(getattr(found, "__func__", found))
    if not isinstance(function, FunctionType):
        setattr(place, name, change(found))
        return
    original = FunctionType(function.__code__, function.__globals__, name, function.__defaults__, function.__closure__)
    original.__kwdefaults__ = function.__kwdefaults__
    key = f"mutated {name}"
    function.__globals__[key] = partial(change, original)

    def call(*args: Any, **more: Any) -> Any:
        return MUTATION(*args, **more)  # type: ignore[name-defined] # noqa: F821

    function.__code__ = call.__code__.replace(co_names=(key,))
    function.__defaults__ = function.__kwdefaults__ = None


def _built(program: Callable[..., Any], *more: Any) -> Any:
    """A mutated program. One that does not build says nothing about the tests."""
    from cltrace.base.errors import BuildError

    try:
        return program(*more)
    except BuildError as error:
        give_up(str(error))


def give_up(message: str) -> None:
    print(message, file=sys.__stderr__, flush=True)
    os._exit(NOT_MUTATED)


def start() -> None:
    """Makes the mutation that the environment names."""
    try:
        from mutations import MUTATIONS

        if name := os.environ.get(VARIABLE):
            MUTATIONS[name].make()
    except Exception:
        give_up(traceback.format_exc())
