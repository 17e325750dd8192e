"""The machine is shared evenly by what each has spent, whatever the lengths of their turns."""

from __future__ import annotations

import threading

import pytest

from analysis.live.turns import Over, Turns


class Machine:
    """A clock that goes on when somebody works."""

    def __init__(self) -> None:
        self.time_s = 0.0

    def __call__(self) -> float:
        return self.time_s


def worked(turns: Turns, machine: Machine, step_s: float, until_s: float, log: list, who: int) -> None:
    try:
        turns.take(who)
        while machine.time_s < until_s:
            machine.time_s += step_s
            log.append((who, step_s))
            turns.offer(who)
    except Over:
        pass
    finally:
        turns.leave(who)


def test_all_spend_the_same_however_long_their_turns_are() -> None:
    machine, log = Machine(), []
    turns = Turns(machine)
    numbers = [turns.join() for _ in range(3)]
    steps = (0.5, 0.125, 0.0625)
    threads = [
        threading.Thread(target=worked, args=(turns, machine, step, 30.0, log, who))
        for who, step in zip(numbers, steps, strict=True)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(10)
    spent = {who: sum(s for one, s in log if one == who) for who in numbers}
    assert max(spent.values()) - min(spent.values()) <= max(steps)
    at, behind = dict.fromkeys(numbers, 0.0), 0.0
    for who, step in log:
        behind = max(behind, at[who] - min(at.values()))
        at[who] += step
    assert behind == 0.0, "who goes on has spent least"


def test_nobody_works_in_a_halt_and_who_is_to_end_ends() -> None:
    machine, log = Machine(), []
    turns = Turns(machine)
    who = turns.join()
    turns.halt()
    thread = threading.Thread(target=worked, args=(turns, machine, 0.5, 1e9, log, who))
    thread.start()
    thread.join(0.05)
    assert log == [] and thread.is_alive()
    turns.end(who)
    thread.join(10)
    assert not thread.is_alive() and log == []
    turns.go_on()


def test_a_halt_waits_for_who_works() -> None:
    machine, log = Machine(), []
    turns = Turns(machine)
    who = turns.join()
    thread = threading.Thread(target=worked, args=(turns, machine, 0.5, 1e9, log, who))
    thread.start()
    turns.halt()
    count = len(log)
    thread.join(0.05)
    assert len(log) == count
    turns.end(who)
    turns.go_on()
    thread.join(10)
    assert not thread.is_alive()


def test_who_comes_late_or_was_held_up_is_not_favoured() -> None:
    machine = Machine()
    turns = Turns(machine)
    first = turns.join()
    turns.take(first)
    machine.time_s = 5.0
    turns.offer(first)
    second = turns.join()
    turns.offer(first)  # who is there already goes on, though both have spent the same
    turns.end(first)
    with pytest.raises(Over):
        turns.offer(first)
    turns.leave(first)
    third = turns.join()
    turns.take(second)
    machine.time_s = 9.0
    turns.forgive(second)
    machine.time_s = 9.5
    assert turns.worked(second) == 4.5 and turns.worked(third) == 0.0
    turns.leave(third)
    turns.end(second)
    with pytest.raises(Over):
        turns.offer(second)
