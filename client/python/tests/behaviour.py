"""What the package promises, against a running daemon: python behaviour.py CELL."""

import sys
import threading
import time

import numpy as np
import trued

CELL = sys.argv[1]
Q = np.array([0.2, 0.3, -0.2, 0.3, 0.8, 0.1])


def raises(kind: type[BaseException], call, *arguments, **named) -> BaseException:
    try:
        call(*arguments, **named)
    except kind as error:
        assert len(str(error)) > 15, f"{error!r} has no words"
        return error
    raise AssertionError(f"{call} did not raise {kind.__name__}")


def arguments_are_checked(client: trued.Client, force: trued.ForceSource) -> None:
    raises(ValueError, trued.Client, "No Name")
    raises(ValueError, trued.Client, CELL, -1.0)
    raises(ValueError, trued.Client, CELL, float("nan"))
    raises(ValueError, trued.Client, CELL, float("inf"))
    raises(ValueError, client.send, [])
    raises(ValueError, client.send, np.zeros(17))
    raises(ValueError, client.target_for, np.zeros(17))
    raises(ValueError, client.send, np.zeros(12)[::2])
    raises(ValueError, client.send, "joints")
    raises(ValueError, client.set_horizon, np.zeros(6))
    raises(ValueError, client.set_horizon, np.zeros((2, 17)))
    raises(ValueError, client.set_horizon, np.zeros((2, 3, 6)))
    raises(ValueError, client.set_horizon, [[0.0] * 6, [0.0] * 5])
    assert "joint 6 of point 2" in str(raises(ValueError, client.set_horizon, [Q, [0.0] * 5 + [np.nan]]))
    assert client.set_horizon([Q, list(Q)]) == 2, "rows are lists or arrays"
    assert client.set_horizon(np.stack([Q, Q + 1.0], axis=1).T) == 2, "stored column by column"
    assert client.set_horizon(np.tile(Q, (200, 1))) == 128, "of too many points the first"
    assert client.set_horizon([]) == client.set_horizon(np.zeros((0, 6))) == 0, "nothing known ahead"
    raises(ValueError, force.send, np.zeros((4, 2)), 0, 1000.0)
    raises(ValueError, force.send, np.zeros((513, 3)), 0, 1000.0)
    raises(ValueError, force.send, np.zeros((3, 8)).T, 0, 1000.0)
    raises(TypeError, force.send, [[0.0, 0.0, 0.0]], 0, 1000.0)
    assert client.send([0.2, 0.3, -0.2, 0.3, 0.8, 0.1]) > 0, "a list is as good as an array"
    force.send(np.zeros((100, 3), dtype=np.float32), trued.monotonic_ns(), 10000.0)


def errors_have_their_kind(client: trued.Client) -> None:
    assert isinstance(raises(trued.NoDaemon, trued.Client, "nobody", 0.01), trued.TruedError)
    raises(trued.RoleTaken, trued.Client, CELL, 0.1)
    raises(trued.TimedOut, client.wait_corrected, 2**63, 0.01)
    raises(TimeoutError, client.wait_corrected, 2**63, 0.01)
    raises(trued.Refused, client.reload, "/nowhere/model.toml")


def arrays_are_views_that_cannot_be_written(client: trued.Client) -> None:
    target = client.exchange(Q, 1.0)
    assert target.joints is target.joints, "one array, however often it is looked at"
    assert target.joints.dtype == np.float64 and target.joints.shape == (6,)
    assert not target.joints.flags.writeable
    seq = client.send(Q)
    answer = client.wait_corrected(seq, 10.0)
    kept = answer.correction
    assert kept.shape == (6,) and np.abs(kept).max() < 0.05
    before = kept.copy()
    del answer
    client.exchange(Q + 0.01, 1.0)
    np.testing.assert_array_equal(kept, before)


def a_command_that_is_no_number_is_an_error_and_changes_nothing(client: trued.Client) -> None:
    before = client.exchange(Q, 1.0)
    raises(ValueError, client.target_for, np.full(6, np.nan))
    raises(ValueError, client.send, np.full(6, np.inf))
    last = client.last_target()
    assert last is not None
    np.testing.assert_array_equal(last.joints, before.joints)


def the_interpreter_is_free_while_one_waits(client: trued.Client) -> None:
    turns = 0
    over = threading.Event()

    def count() -> None:
        nonlocal turns
        while not over.is_set():
            turns += 1
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    raises(trued.TimedOut, client.wait_corrected, 2**63, 0.5)
    over.set()
    counter.join()
    assert turns > 50, f"another thread ran {turns} times in half a second"


def a_second_thread_is_told(client: trued.Client) -> None:
    waiting = threading.Thread(target=lambda: raises(trued.TimedOut, client.wait_corrected, 2**63, 1.0))
    waiting.start()
    time.sleep(0.2)
    raises(trued.Busy, client.send, Q)
    raises(trued.Busy, client.close)
    waiting.join()
    client.send(Q)


def what_is_closed_says_so(client: trued.Client) -> None:
    client.close()
    client.close()
    raises(trued.Closed, client.send, Q)
    with trued.Client(CELL, 10.0) as again:
        assert again.connection().is_connected
        assert (status := again.status()) is not None and status.joints == 6
        assert status.pid == again.connection().pid
        assert (status.robot_maker, status.robot_type, status.robot_serial) == ("ABB", "IRB 1600-6/1.45", "")
        assert str(status).startswith(f"{status.health}, mode {status.mode}, not bypassed; "), status
        assert status.message in str(status) and repr(status).startswith("Status(health=")
        assert trued.contract().startswith(f"trued {trued.__version__} ")
        assert status.geometry_hash != 0 and status.stale_temperatures == 0
    raises(trued.Closed, again.status)


def main() -> None:
    client = trued.Client(CELL, timeout=10.0)
    with trued.ForceSource(CELL, timeout=10.0) as force:
        arguments_are_checked(client, force)
    for claim in [
        errors_have_their_kind,
        arrays_are_views_that_cannot_be_written,
        a_command_that_is_no_number_is_an_error_and_changes_nothing,
        the_interpreter_is_free_while_one_waits,
        a_second_thread_is_told,
        what_is_closed_says_so,
    ]:
        claim(client)
        print(claim.__name__)


main()
