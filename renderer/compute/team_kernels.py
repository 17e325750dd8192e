"""Kernel entry points of :mod:`renderer.compute.team`; the C++ is in ``native/team.h``."""

from __future__ import annotations

import warp as wp

from renderer.compute.launching import Address
from renderer.compute.native_code import module_options

wp.set_module_options(module_options("team.h"))


@wp.func_native("team::serve((long long*)mailbox, patience_us);")
def native_serve(mailbox: Address, patience_us: wp.int64): ...


@wp.func_native("team::post((long long*)mailbox, function, bounds, arguments);")
def native_post(mailbox: Address, function: wp.int64, bounds: wp.int64, arguments: wp.int64): ...


@wp.func_native("team::join((long long*)mailbox);")
def native_join(mailbox: Address): ...


@wp.kernel
def serve(mailbox: Address, patience_us: wp.int64):
    """The loop of a helper."""
    native_serve(mailbox, patience_us)


@wp.kernel
def post(mailbox: Address, function: wp.int64, bounds: wp.int64, arguments: wp.int64):
    """Posts a launch to a helper."""
    native_post(mailbox, function, bounds, arguments)


@wp.kernel
def join(mailbox: Address):
    """Waits for a helper, or takes back work that it has not begun."""
    native_join(mailbox)
