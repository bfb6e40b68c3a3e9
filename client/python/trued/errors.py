"""What may go wrong. Each has words that say what to do; what is called wrongly is a ValueError or TypeError."""


class TruedError(Exception):
    """All of them."""

    kind = "error"


class NotSent(TruedError):
    """Nothing was sent or asked: there is no daemon to talk to now. The loop goes on with `target_for`."""


class DaemonLost(NotSent):
    """The daemon was there and is gone; it is joined again by itself when it comes back."""

    kind = "daemon_lost"


class DaemonRestarted(NotSent):
    """Another daemon than before was joined. Said once: call again."""

    kind = "daemon_restarted"


class VersionMismatch(NotSent):
    """Daemon and library are of different versions."""

    kind = "version_mismatch"


class WrongUser(NotSent):
    """The cell belongs to another user."""

    kind = "wrong_user"


class RoleTaken(NotSent):
    """Another process has this role."""

    kind = "role_taken"


class TransportFailed(NotSent):
    """The shared memory refused."""

    kind = "transport"


class MessageLost(NotSent):
    """The daemon does not take messages fast enough: this one is lost, and counted."""

    kind = "message_lost"


class NoDaemon(TruedError):
    """Connecting: no daemon announced itself in time."""

    kind = "no_daemon"


class DaemonSilent(TruedError):
    """The daemon is joined and says nothing."""

    kind = "daemon_silent"


class TimedOut(TruedError, TimeoutError):
    """No answer in time."""

    kind = "timed_out"


class SystemFailed(TruedError):
    """The operating system refused."""

    kind = "system"


class Refused(TruedError):
    """The daemon refused what was asked; the words are its own."""

    kind = "refused"


class Failed(TruedError):
    """The daemon failed in doing what was asked; the words are its own."""

    kind = "failed"


class Closed(TruedError):
    """The object has been closed."""

    kind = "closed"


class Busy(TruedError):
    """Another thread is in a call with this object."""

    kind = "busy"
