"""The table of abi.py in OpenCL C: a header that stands before the kernel's own files, and the compiler's options.

`python -m cltrace.plan.opencl` prints the header.
"""

from __future__ import annotations

from itertools import groupby

from cltrace.plan.abi import (
    ARGUMENTS,
    CONSTANTS,
    COUNTERS,
    FLAGS,
    LIGHT_KINDS,
    SHAPES,
    STRUCTS,
    Argument,
    Precision,
    dtype_of,
    real_dtype,
    shade_dtype,
)


def options(precision: Precision, features: frozenset[str], branches: int = 1) -> list[str]:
    """The compiler's -D options for a precision and flags that are set. KeyError for one that is not in FLAGS.

    branches: room for so many rays of a pixel that wait for others.
    """
    for name in features:
        FLAGS[name]
    sizes = {
        "REAL_BYTES": real_dtype(precision).itemsize,
        "SHADE_BYTES": shade_dtype(precision).itemsize,
        "BRANCHES": branches,
        **{f"{name}_BYTES": dtype_of(name, precision).itemsize for name in STRUCTS},
    }
    return [f"-D{k}={v}" for k, v in sizes.items()] + [f"-D{name}" for name in sorted(features)]


def header() -> str:
    """The table in OpenCL C: constants, structs, and the kernel's parameters as macros."""
    lines = [f"#define {name} {value}" for name, value in CONSTANTS.items()]
    lines += [f"#define IS_{name} 0" for name in FLAGS]
    lines += [f"#define {kind.upper()}_LIGHT {i}" for i, kind in enumerate(LIGHT_KINDS)]
    lines += [f"#define {name} {i}" for i, name in enumerate(COUNTERS)] + [f"#define COUNTERS {len(COUNTERS)}"]
    for name, fields in STRUCTS.items():
        lines += _struct(name, [(f"{f.type} {f.name}", f.text) for f in fields])
        # The build fails here, by name, if the host lays a struct out differently.
        lines.append(f"typedef char layout_of_{name}_differs_from_numpy[sizeof({name}) == {name}_BYTES ? 1 : -1];")
    groups: dict[str, list[Argument]] = {}
    for argument in ARGUMENTS:
        groups.setdefault(argument.group, []).append(argument)
    del groups[""]
    parts = ("Geometry", "Lists", "Tree")
    needs = {part: _common_need(groups[part]) for part in parts}
    for name in (*parts, "Frame", "Scene", "Outputs"):
        members = [(a.parameter.removeprefix("const "), a.text) for a in groups[name]]
        lines += _struct(name, [(f"{part} {part.lower()}", "") for part in parts if name == "Scene"] + members)
    lines += _list_macro("RENDER_PARAMETERS", [(a.parameter, a.needs) for a in ARGUMENTS])
    for name, arguments in groups.items():
        values = [(f".{a.name} = {a.name}", "" if a.needs == needs.get(name) else a.needs) for a in arguments]
        nested = [(f".{part.lower()} = {part.upper()}_OF_PARAMETERS", needs[part]) for part in parts]
        lines += _list_macro(f"{name.upper()}_OF_PARAMETERS", values + (nested if name == "Scene" else []), "{", "}")
    return "\n".join(lines) + "\n"


def for_its_shape(name: str, text: str) -> str:
    """A kernel's file, of a shape's folder only where there are such: but for the first one, of whose parts others are
    made."""
    for shape in SHAPES[1:]:
        if name.startswith(f"shapes/{shape}/"):
            return f"#ifdef WITH_{shape.upper()}S\n#line 1\n{text}#endif\n"
    return text


def _common_need(arguments: list[Argument]) -> str:
    """The flag that all of them need, "" if there is none."""
    needs = {a.needs for a in arguments}
    return needs.pop() if len(needs) == 1 else ""


def _guarded(needs: str, lines: list[str], otherwise: tuple[str, ...] = ()) -> list[str]:
    """Lines that are there only if a flag is set, and those that are there if it is not."""
    if not needs:
        return lines
    return [f"#ifdef {needs}", *lines, *(("#else", *otherwise) if otherwise else ()), "#endif"]


def _list_macro(name: str, items: list[tuple[str, str]], opening: str = "", closing: str = "") -> list[str]:
    """A macro that is a list of items, each of which is left out where the flag is not set that it needs.

    The first one needs none.
    """
    lines: list[str] = []
    parts: list[str] = []
    for needs, run in groupby(items, key=lambda item: item[1]):
        part = f"{name}_{len(parts)}"
        text = (", " if parts else "") + ", ".join(item for item, _ in run)
        lines += _guarded(needs, [f"#define {part} {text}"], (f"#define {part}",))
        parts.append(part)
    return [*lines, f"#define {name} {opening}{' '.join(parts)}{closing}"]


def _struct(name: str, fields: list[tuple[str, str]]) -> list[str]:
    """A struct of fields (declaration, comment)."""
    rows = [f"    {declaration};{f' /* {text} */' if text else ''}" for declaration, text in fields]
    return ["typedef struct {", *rows, f"}} {name};"]


if __name__ == "__main__":
    print(header(), end="")
