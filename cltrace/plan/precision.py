"""In which precision a scene's colours are computed: in float, unless what floats are off by could be seen."""

from __future__ import annotations

import math
from dataclasses import replace

from cltrace.plan.abi import Precision
from cltrace.plan.bounces import NO_BOUNCES
from cltrace.scene import Scene

# Up to these, float's colours are within 1/16 of a byte's level of double's. Let u = 2^-24, let A be what lights and
# materials together can add to a pixel, and E an exponent. What is brighter than white is white, so only colours up to
# 1 count.
# n.l is off by 4 u at most, and so what is diffuse by 255 * 4 u A levels: 0.016.
BRIGHTEST = 2.0**8
# A highlight is A exp(-E |e|^2 / 2) where e = r - v is small. |e| is off by d = 12 u at most, as each part of it is off
# by a few u, and so the highlight by E |e| d times itself. With at most 1 of it left, that is largest where it has just
# come down to 1, |e|^2 = 2 ln(A) / E, and for A < e^(1/2) where |e|^2 = 1 / E. There it is sqrt(E max(1, 2 ln(A))) d,
# which is 0.047 levels.
SHARPEST = 2.0**16
# With an exponent E < 1 the highlight is steep where r.v is 0, and ends there: what is off by d may lose all of d^E,
# which is 0.053 levels here, and more of lower ones. With E = 0 it does not end.
FLATTEST = 0.6


def precision_for(scene: Scene, precision: Precision) -> Precision:
    """What a precision that was asked for means for the colours of a scene: "accurate" becomes "double" where needed.

    Both decide alike, so nothing but colours depends on it.
    """
    if precision != "accurate":
        return precision
    shade = scene.columns.every_shade()
    kd, ks, color, exponent = (float(shade[name].max(initial=0)) for name in ("kd", "ks", "color", "exponent"))
    goes_on = float((shade["reflectance"] + shade["transmittance"]).max(initial=0))
    light = float(scene.lamps["color"].sum(axis=0).max(initial=0))
    light *= replace(NO_BOUNCES, most=goes_on).growth(scene.camera.max_bounces)
    flat = bool(((shade["exponent"] > 0) & (shade["exponent"] < FLATTEST)).any())
    sharp = exponent * max(1.0, 2 * math.log(max(1.0, ks * light))) > SHARPEST
    bright = max(kd * color, ks) * light > BRIGHTEST
    return "double" if bright or ((flat or sharp) and ks * light > 0) else precision
