"""The order of spheres in memory, made on a device: the same as cltrace.plan.order makes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from cltrace.base.waiting import Announcement
from cltrace.plan.abi import Precision
from cltrace.plan.order import Curve
from cltrace.run.devices import Device, driver_errors
from cltrace.run.pack.toolbox import Toolbox, is_exact

# As in kernels/pack/order.cl.
DIGIT_BITS = 11
# Each one has its own count of all digits, and takes them in order.
ITEMS = 32


class Order:
    """What puts points into the order of spatial_order() on a device."""

    def __init__(self, tools: Toolbox, device: Device) -> None:
        self._tools, self._device = tools, device

    @classmethod
    def on(cls, device: Device, precision: Precision) -> Order | None:
        """None for a device that computes otherwise than numpy, or that is no processor of the host.

        precision: what is packed for; programs differ, orders do not.
        """
        if device.kind != "cpu" or not is_exact(device):
            return None
        with driver_errors(device):
            return cls(Toolbox(device, precision), device)

    def __call__(self, center: NDArray[np.floating]) -> NDArray[np.int32]:
        """The indices of points (n, 3), see spatial_order(). Raises BuildError and DeviceError as Executor does."""
        with driver_errors(self._device), Announcement("compiling the kernel ..."):
            return self._order(np.ascontiguousarray(center))

    def _order(self, center: NDArray[np.floating]) -> NDArray[np.int32]:
        tools, n = self._tools, len(center)
        points = {"n": n, "wide": center.itemsize == 8, "center": tools.share(center)}
        ends = tools.noted("ends", 6, np.float64, **points).max(axis=0)
        curve = Curve.of(n, -ends[::2], ends[1::2])
        bits, low = curve.index_bits, curve.low / 2
        key, other, index = tools.room(n, np.uint64), tools.room(n, np.uint64), tools.room(n, np.int32)
        tools.run("order_keys", **points, index_bits=bits, half_low=low, scale=curve.scale, key=key)
        digits = tools.room(ITEMS << DIGIT_BITS, np.int32)
        for shift in range(bits, bits + 3 * curve.bits, DIGIT_BITS):
            tools.run("count_digits", items=ITEMS, n=n, shift=shift, key=key, count=digits)
            tools.run("start_digits", items=ITEMS, rows=ITEMS, count=digits)
            tools.run("move_keys", items=ITEMS, n=n, shift=shift, key=key, next=digits, moved=other)
            key, other = other, key
        tools.run("indices", n=n, mask=(1 << bits) - 1, key=key, index=index)
        return tools.read(index, n, np.int32)
