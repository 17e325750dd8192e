"""Settings shared by all tests."""

import signal

from hypothesis import settings

settings.register_profile("tsar", deadline=None, max_examples=60, derandomize=True)
settings.load_profile("tsar")

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # as in a shell's background: tests of interrupts need what a process in front has
    signal.signal(signal.SIGINT, signal.default_int_handler)
