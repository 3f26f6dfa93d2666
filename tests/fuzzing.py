"""Valid scenes with their meshes and textures, and what damages them: text, trees, numbers, encodings, ends, bytes.

Each is the same for the same random.Random. FUZZ=N in the environment makes all of these tests N times as long, with
other cases than those of an ordinary run.
"""

from __future__ import annotations

import io
import os
import random
import re
import struct
import zlib
from collections.abc import Callable

from hypothesis import HealthCheck, settings
from lxml import etree
from PIL import Image

FACTOR = int(os.environ.get("FUZZ", "1"))
Files = dict[str, bytes]  # by their names


def examples(count: int) -> settings:
    """So many of hypothesis' own cases, the same ones in each ordinary run."""
    slow = [HealthCheck.too_slow]
    return settings(deadline=None, max_examples=count * FACTOR, derandomize=FACTOR == 1, suppress_health_check=slow)


SCENE = """<scene output_file="s.png">
<background_color {rgb}/>
<camera><position x="{a}" y="0.5" z="6"/><lookat x="0" y="{b}" z="0"/><up x="0" y="1" z="0"/>
<horizontal_fov angle="{angle}"/><resolution horizontal="9" vertical="7"/><max_bounces n="{bounces}"/></camera>
<lights>
<ambient_light><color {rgb}/></ambient_light>
<parallel_light><color {rgb}/><direction x="{a}" y="-2" z="{b}"/></parallel_light>
<point_light><color {rgb}/><position x="{b}" y="3" z="{a}"/></point_light>
<spot_light><color {rgb}/><position x="1" y="{c}" z="3"/><direction x="{a}" y="-1" z="-2"/>
<falloff alpha1="{angle}" alpha2="50"/></spot_light>
</lights>
<surfaces>
<sphere radius="{c}"><position x="{a}" y="{b}" z="0"/>
<material_solid><color {rgb}/><phong ka="0.2" kd="0.7" ks="{c}" exponent="20"/>
<reflectance r="0.5"/><transmittance t="0.3"/><refraction iof="{index}"/></material_solid>
<transform><translate x="{b}" y="0" z="{a}"/><rotateY theta="{angle}"/><scale x="1" y="{c}" z="1"/></transform></sphere>
<mesh name="m.obj"><material_textured><texture name="t.png"/><phong ka="0.2" kd="0.7" ks="0.1" exponent="{c}"/>
<reflectance r="0.1"/><transmittance t="0"/><refraction iof="1"/></material_textured>
<transform><rotateX theta="{angle}"/><rotateZ theta="10"/></transform></mesh>
</surfaces>
</scene>
"""
OBJ = """# corners
v -1.5 -1 0
v 1.5 -1 {a}
v 1.5e0 +1 0
v -1.5 1. {b} 1
vt 0 0
vt 1 0 0
vt {b} .75
vn 0 0 1
vn {a} 0 1
o part
s off
f 1/1/1 2/2/2 3/3/1
f -4/-3/-2 3/3/1 \\
 4/1/2
f 1 2 3 4
"""
# What stands for a number: zeros, ends of float32 and beyond, other notations, and none.
_NUMBERS = (
    "0 -0 1 -1 2 0.5 1e-45 1e-46 1e-400 3.4028234e38 3.5e38 1e308 1e400 -1e39 nan inf -Infinity 0x10 1_000 1,5 1. .5 . "
    "- + e 1e 1e+ 00012 2147483647 2147483648 4294967296 9007199254740993 1e22 1e-22 89.9999999 90 180 360 65535 65536"
)
NUMBERS = [*_NUMBERS.split(), "", " 1 ", "1 2", "\u0661", "\uff11", "1\u00a0", "9" * 400, "0." + "0" * 400 + "1"]
_NAMES = "m.obj t.png s.xml ../m.obj /etc/passwd /dev/zero . .. ./m.obj m.obj/ none.obj a\\b.obj ~ con -"
NAMES = [
    *_NAMES.split(),
    *("", " ", "x" * 300, "\u00e4.obj", "\U0001f600.png", "a\nb.png", "%s%n", "{}", "s.png", "sub/s.png", "/tmp/s.png"),
]
TAGS = sorted({*re.findall(r"<(\w+)", SCENE), "include", "other"})
WORDS = [
    *b"\n|\r|\x0c|\0|\xff|\xfe\xff|\xef\xbb\xbf|\xe2\x80\xa8| 9999999999 |v 1 2\n".split(b"|"),
    *b"/ // nan -1 e9 < > & &lt; &#0; &#x110000; ]]> <![CDATA[ <!-- --> <?xml?> ' = \" <!DOCTYPE> mtllib".split(b" "),
]
# Bombs and reaches outside of the folder, before the root.
PROLOGUES = [
    '<!DOCTYPE scene SYSTEM "file:///etc/passwd">',
    '<!DOCTYPE scene [<!ENTITY x "1"><!ENTITY y "&x;&x;&x;&x;&x;&x;&x;&x;">]>',
    '<!DOCTYPE scene [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
    '<!DOCTYPE scene [<!ATTLIST sphere radius CDATA "1">]>',
    "<?xml-stylesheet href='x'?><!-- \u00e4 -->",
]
ENCODINGS = ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "utf-32", "latin-1", "cp037", "utf-7", "ascii"]


def valid(rng: random.Random) -> Files:
    """A scene, its mesh and its texture. All have the same elements, so that one kernel draws most of them."""
    values = {name: f"{rng.uniform(-1, 1):.{rng.randrange(1, 17)}f}" for name in "ab"}
    values |= {"c": f"{rng.uniform(0.2, 1):g}", "angle": f"{rng.uniform(5, 40):.3f}", "bounces": str(rng.randrange(3))}
    values |= {"index": f"{rng.uniform(1.1, 2):g}", "rgb": f'r="{rng.random():.3f}" g="1" b="{rng.random():g}"'}
    size, mode = (rng.randrange(1, 9), rng.randrange(1, 9)), rng.choice(["RGB", "L", "P", "1", "RGBA", "I;16"])
    channels = {"RGBA": 4, "RGB": 3, "I;16": 2}.get(mode, 1)
    pixels = Image.frombytes("L" if mode in "P1" else mode, size, rng.randbytes(size[0] * size[1] * channels))
    file = io.BytesIO()
    if mode in "RGBL" and rng.random() < 0.4:
        pixels.convert("RGB").save(file, "JPEG", progressive=rng.random() < 0.5)
    else:
        (pixels.convert(mode) if mode in "P1" else pixels).save(file, "PNG")
    return {"s.xml": SCENE.format(**values).encode(), "m.obj": OBJ.format(**values).encode(), "t.png": file.getvalue()}


def damaged(rng: random.Random, files: Files) -> Files:
    """The same with one to three mistakes, each in one of the files, more often in the scene."""
    found = dict(files)
    for _ in range(rng.choice([1, 1, 1, 2, 3])):
        name = rng.choice(["s.xml", "s.xml", "m.obj", "t.png"])
        if rng.random() < 0.02:
            del found[name]
            return found
        ways: list[Way] = [with_bytes, *STRUCTURE[name]]
        found[name] = rng.choice(ways)(rng, found[name])
    return found


Way = Callable[[random.Random, bytes], bytes]


def with_bytes(rng: random.Random, data: bytes) -> bytes:
    """Bytes that are changed, cut out, doubled or put in, or an end that is missing, or one more of it."""
    out = bytearray(data)
    for _ in range(rng.choice([1, 1, 2, 5])):
        at, kind = rng.randrange(len(out) + 1), rng.randrange(7)
        if kind == 0:
            out[at : at + 1] = [rng.choice([0, 255, rng.randrange(256)])]
        elif kind == 1:
            del out[at : at + rng.randrange(1, 40)]
        elif kind == 2:
            out[at:at] = out[at : at + rng.randrange(1, 200)]
        elif kind == 3:
            out[at:at] = rng.choice(WORDS)
        elif kind == 4:
            other = rng.randrange(len(out) + 1)
            out[at : at + 9] = out[other : other + 9]
        elif kind == 5 and rng.random() < 0.3:
            del out[at:]
        elif rng.random() < 0.3:
            out += rng.choice([out[at:], rng.randbytes(20), b"\0" * 20, b" " * 20])
    return bytes(out)


def with_tree(rng: random.Random, data: bytes) -> bytes:
    """Elements that are missing, doubled, moved, renamed or within others; attributes likewise, and their values."""
    try:
        root = etree.fromstring(data)
    except (etree.XMLSyntaxError, ValueError):
        return with_bytes(rng, data)
    for _ in range(rng.choice([1, 1, 2, 4])):
        _change(rng, root)
    text = etree.tostring(root, encoding="unicode")
    if rng.random() < 0.1:
        text = rng.choice(PROLOGUES) + text
        if rng.random() < 0.5:
            text = text.replace('"1"', '"&x;"', 1)
    if rng.random() < 0.1:
        declared, used = rng.choice(ENCODINGS), rng.choice(ENCODINGS)
        used = rng.choice([declared, used])
        return f'<?xml version="1.0" encoding="{declared}"?>{text}'.encode(used, "replace")
    return text.encode(errors="surrogatepass")


def _change(rng: random.Random, root: etree._Element) -> None:
    elements = list(root.iter(etree.Element))
    one, other, kind = rng.choice(elements), rng.choice(elements), rng.randrange(12)
    parent, names = one.getparent(), sorted(one.attrib)
    if kind == 0 and parent is not None:
        parent.remove(one)
    elif kind == 1:
        copy = etree.tostring(one, with_tail=False)
        for _ in range(rng.choice([1, 1, 2, 30]) if len(elements) < 200 and len(copy) < 1000 else 1):
            other.insert(rng.randrange(len(other) + 1), etree.fromstring(copy))
    elif kind == 2 and parent is not None and one not in list(other.iterancestors()) and one is not other:
        other.insert(rng.randrange(len(other) + 1), one)
    elif kind == 3:
        one.tag = rng.choice(TAGS)
    elif kind == 4:
        one.text = rng.choice(["x", " \t", "1", "\u00e4", "]]&gt;"])
    elif kind == 5 and names:
        del one.attrib[rng.choice(names)]
    elif kind == 6:
        one.set(rng.choice(["x", "r", "radius", "name", "theta", "X", "xmlns-a", "{urn:a}x", "n"]), rng.choice(NUMBERS))
    elif kind == 7 and names and other.attrib:
        one.set(rng.choice(names), rng.choice(sorted(other.attrib.values())))
    elif kind == 8:
        one.append(rng.choice([etree.Comment(" \u00e4 "), etree.ProcessingInstruction("a", "b")]))
    elif names:
        name = rng.choice(names)
        one.set(name, rng.choice(NAMES if "name" in name or "file" in name else NUMBERS))


def with_lines(rng: random.Random, data: bytes) -> bytes:
    """Lines of an OBJ file that are missing, doubled or exchanged, words and indices that are others, other ends."""
    lines = data.split(b"\n")
    for _ in range(rng.choice([1, 1, 3])):
        at, other, kind = rng.randrange(len(lines)), rng.randrange(len(lines)), rng.randrange(6)
        words = lines[at].split()
        if kind == 0:
            lines[at] = b""
        elif kind == 1:
            lines[at:at] = [lines[other]] * rng.choice([1, 1, 50])
        elif kind == 2:
            lines[at], lines[other] = lines[other], lines[at]
        elif kind == 3 and words:
            words[rng.randrange(len(words))] = rng.choice(NUMBERS).encode()
            lines[at] = b" ".join(words)
        elif kind == 4:
            index = [str(rng.choice([*range(-6, 7), 2**31, 2**63, -(2**63) - 1])) for _ in range(rng.randrange(1, 5))]
            lines[at] = lines[at] + b" " + rng.choice(["/", "//", "/1/"]).join(index).encode()
        elif words:
            lines[at] = rng.choice([b"v", b"vt", b"vn", b"f", b"g", b"l", b"vp", b"F", b"\tv"]) + lines[at][1:]
    return rng.choice([b"\n", b"\n", b"\n", b"\r\n", b"\r", b" \\\n\n", b"\n\n", b"#\n"]).join(lines)


def with_chunks(rng: random.Random, data: bytes) -> bytes:
    """Parts of a PNG that are missing, doubled, exchanged or others, with right checksums."""
    if not data.startswith(b"\x89PNG"):
        return with_bytes(rng, data)
    chunks, at = [], 8
    while len(data) - at >= 12:
        length, kind = struct.unpack_from(">I4s", data, at)
        chunks.append((kind, data[at + 8 : at + 8 + length]))
        at += 12 + length
    if not chunks:
        return data
    i, j, way = rng.randrange(len(chunks)), rng.randrange(len(chunks)), rng.randrange(5)
    if way == 0:
        del chunks[i]
    elif way == 1:
        chunks.insert(j, chunks[i])
    elif way == 2:
        chunks[i], chunks[j] = chunks[j], chunks[i]
    elif way == 3:
        names = [b"tRNS", b"gAMA", b"iCCP", b"eXIf", b"PLTE", b"zTXt", b"acTL", b"sRGB", b"zzZZ", b"IDAT"]
        bodies = [b"", b"\0", rng.randbytes(5), b"a\0\0" + zlib.compress(bytes(2**16)), b"Exif\0\0" + rng.randbytes(9)]
        chunks.insert(i, (rng.choice(names), rng.choice(bodies)))
    else:
        chunks[i] = (chunks[i][0], with_bytes(rng, chunks[i][1]))
    parts = (struct.pack(">I", len(of)) + kind + of + struct.pack(">I", zlib.crc32(kind + of)) for kind, of in chunks)
    return data[:8] + b"".join(parts)


STRUCTURE: dict[str, list[Way]] = {
    "s.xml": [with_tree, with_tree, with_tree],
    "m.obj": [with_lines, with_lines],
    "t.png": [with_chunks],
}
