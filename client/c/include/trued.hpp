// C++17 interface of the trued client library: a thin header-only layer over trued.h.
//
// Handles close themselves and are move-only; no call waits longer than its time limit.
// States of the daemon are returned as values (a trued::code, an empty optional), so that an outage throws no exception in the robot's loop.
// Failed connections, failed requests and wrong arguments (such as the number of joints) throw trued::error.
// An object must be used by one thread at a time. The binary interface of the library contains no C++ types.
#ifndef TRUED_HPP
#define TRUED_HPP

#include <array>
#include <chrono>
#include <cstdint>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include "trued.h"

// False positive of GCC 12 for the handle of an empty std::optional.
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wmaybe-uninitialized"
#endif

namespace trued {

using std::chrono::nanoseconds;

// Result of a call: the values of trued_code.
enum class code : std::int32_t {
    ok = TRUED_OK, nothing = TRUED_NOTHING, null_pointer = TRUED_ERROR_NULL, struct_size = TRUED_ERROR_STRUCT_SIZE,
    argument = TRUED_ERROR_ARGUMENT, closed = TRUED_ERROR_CLOSED, busy = TRUED_ERROR_BUSY,
    too_many = TRUED_ERROR_TOO_MANY, internal = TRUED_ERROR_INTERNAL, no_daemon = TRUED_ERROR_NO_DAEMON,
    daemon_lost = TRUED_ERROR_DAEMON_LOST, daemon_restarted = TRUED_ERROR_DAEMON_RESTARTED,
    version_mismatch = TRUED_ERROR_VERSION_MISMATCH, wrong_user = TRUED_ERROR_WRONG_USER,
    role_taken = TRUED_ERROR_ROLE_TAKEN, daemon_silent = TRUED_ERROR_DAEMON_SILENT, timed_out = TRUED_ERROR_TIMED_OUT,
    message_lost = TRUED_ERROR_MESSAGE_LOST, transport = TRUED_ERROR_TRANSPORT, system = TRUED_ERROR_SYSTEM,
    refused = TRUED_ERROR_REFUSED, failed = TRUED_ERROR_FAILED,
};

// Its name in C: "TRUED_ERROR_DAEMON_LOST".
inline const char *name(code c) noexcept { return ::trued_code_name(static_cast<std::int32_t>(c)); }

// How much a cell corrects: the values of trued_mode.
enum class mode : std::uint32_t { shadow = TRUED_MODE_SHADOW, limited = TRUED_MODE_LIMITED, full = TRUED_MODE_FULL };

// Action of the recorder: the values of trued_recorder_action.
enum class recorder_action : std::uint32_t {
    stop = TRUED_RECORDER_ACTION_STOP, start = TRUED_RECORDER_ACTION_START, keep = TRUED_RECORDER_ACTION_KEEP,
};

// The message of this thread's last error.
inline const char *last_error() noexcept { return ::trued_last_error(); }

inline std::uint64_t monotonic_ns() noexcept { return ::trued_monotonic_ns(); }
// A call failed; what() is the library's message.
class error : public std::runtime_error {
public:
    error(code why, const char *words) : std::runtime_error(words), why_(why) {}
    code why() const noexcept { return why_; }

private:
    code why_;
};

using target = trued_target;
using corrected = trued_corrected;
using status = trued_status;
using vibration = trued_vibration;
using connection = trued_connection;
using answer = trued_answer;
using robot_state = trued_robot_state;
using measured = trued_measured;

// A C struct with its size set, otherwise zero.
template <typename T> T made() {
    T value{};
    value.struct_size = static_cast<std::uint32_t>(sizeof(T));
    return value;
}

namespace detail {

[[noreturn]] inline void fail(code why) { throw error(why, ::trued_last_error()); }

// Throws if `c` is an error.
inline void check(trued_code c) {
    if (c < 0) fail(static_cast<code>(c));
}

// The value if there is one; throws on errors.
template <typename T> std::optional<T> found(trued_code c, const T &value) {
    check(c);
    return c == TRUED_NOTHING ? std::nullopt : std::optional<T>(value);
}

// Returns codes after which a loop can continue; throws on wrong arguments.
inline code gone_on(trued_code c) {
    if (c < 0 && c > TRUED_ERROR_NO_DAEMON) fail(static_cast<code>(c));
    return static_cast<code>(c);
}

inline std::uint64_t ns(nanoseconds limit) {
    return limit.count() < 0 ? 0 : static_cast<std::uint64_t>(limit.count());
}

inline std::uint32_t count(std::size_t n) {
    constexpr std::size_t most = std::numeric_limits<std::uint32_t>::max();
    return static_cast<std::uint32_t>(n < most ? n : most);
}

// A handle that closes itself.
template <typename T, trued_code (*Close)(T *)> class handle {
public:
    explicit handle(T *raw) noexcept : raw_(raw) {}
    handle(const handle &) = delete;
    handle &operator=(const handle &) = delete;
    handle(handle &&other) noexcept : raw_(std::exchange(other.raw_, nullptr)) {}
    handle &operator=(handle &&other) noexcept {
        if (this != &other) {
            Close(raw_);
            raw_ = std::exchange(other.raw_, nullptr);
        }
        return *this;
    }
    ~handle() { Close(raw_); }
    T *get() const noexcept { return raw_; }

private:
    T *raw_;
};

template <typename T, trued_code (*Connect)(const char *, const char *, std::uint64_t, T **)>
T *connected(const std::string &cell, nanoseconds limit, const char *runtime_dir) {
    if (::trued_abi_version() >> 16 != TRUED_ABI_VERSION >> 16 || ::trued_abi_version() < TRUED_ABI_VERSION) {
        throw error(code::version_mismatch, "the library loaded is older than this header, or of another major version; "
                                            "build the program anew, or install the library that it was built for");
    }
    T *raw = nullptr;
    check(Connect(cell.c_str(), runtime_dir, ns(limit), &raw));
    return raw;
}

} // namespace detail

// One commanded joint target with optional inputs.
class setpoint {
public:
    // Joints: anything with data() and size(), doubles.
    template <typename Joints> explicit setpoint(const Joints &q) : c_(made<trued_setpoint>()) {
        c_.joints = detail::count(q.size());
        for (std::size_t i = 0; i < q.size() && i < TRUED_JOINTS_MAX; i++) c_.q[i] = q.data()[i];
    }
    // Time for which the target is valid, instead of now.
    setpoint &at_ns(std::uint64_t t_ns) noexcept {
        c_.t_ns = t_ns;
        return *this;
    }
    // Wrench acting on the robot at the TCP: force in N, then moment in N m.
    setpoint &wrench(const std::array<double, 6> &wrench, bool in_base = false) noexcept {
        for (std::size_t i = 0; i < wrench.size(); i++) c_.wrench[i] = wrench[i];
        c_.flags |= TRUED_HAS_WRENCH;
        c_.flags = in_base ? c_.flags | TRUED_WRENCH_IN_BASE : c_.flags & ~static_cast<std::uint32_t>(TRUED_WRENCH_IN_BASE);
        return *this;
    }
    // Degrees Celsius, NaN where unknown.
    template <typename Joints> setpoint &temperatures(double ambient_c, const Joints &joints_c) noexcept {
        for (double &t : c_.temperature_c) t = std::numeric_limits<double>::quiet_NaN();
        c_.temperature_c[0] = ambient_c;
        for (std::size_t i = 0; i < joints_c.size() && i < TRUED_JOINTS_MAX; i++) c_.temperature_c[i + 1] = joints_c.data()[i];
        c_.flags |= TRUED_HAS_TEMPERATURE;
        return *this;
    }
    // Direction of approach of each joint: -1, 0 or 1.
    template <typename Sides> setpoint &direction(const Sides &sides) noexcept {
        for (std::size_t i = 0; i < sides.size() && i < TRUED_JOINTS_MAX; i++) {
            c_.direction[i] = static_cast<std::int8_t>((sides.data()[i] > 0) - (sides.data()[i] < 0));
        }
        c_.flags |= TRUED_HAS_DIRECTION;
        return *this;
    }
    // A pose at rest; honoured only in a lockstep replay.
    setpoint &settled() noexcept {
        c_.flags |= TRUED_SETTLED;
        return *this;
    }
    const trued_setpoint &c() const noexcept { return c_; }

private:
    trued_setpoint c_;
};

// State of the cutting process, for the vibration monitor. By default nothing is stated.
struct process : trued_process {
    process() : trued_process(made<trued_process>()) {
        spindle_rpm = std::numeric_limits<double>::quiet_NaN();
        feed_mm_s = std::numeric_limits<double>::quiet_NaN();
    }
};

// Result of sending a command: its number, or the error code.
struct sent {
    code result;
    std::uint64_t seq;
    explicit operator bool() const noexcept { return result == code::ok; }
};

// Result of sending a horizon: how many of its points were sent, or the error code.
struct horizon_sent {
    code result;
    std::uint32_t points;
    explicit operator bool() const noexcept { return result == code::ok; }
};

namespace detail {

// The C functions of each type of handle.
struct client_calls {
    using raw = trued_client;
    static constexpr auto connect = &::trued_client_connect;
    static constexpr auto close = &::trued_client_close;
    static constexpr auto connection = &::trued_client_connection;
    static constexpr auto next_event = &::trued_client_next_event;
    static constexpr auto status = &::trued_client_status;
    static constexpr auto vibration = &::trued_client_vibration;
    static constexpr auto ping = &::trued_client_ping;
    static constexpr auto reload = &::trued_client_reload;
    static constexpr auto bypass = &::trued_client_bypass;
    static constexpr auto arm = &::trued_client_arm;
    static constexpr auto mode = &::trued_client_mode;
    static constexpr auto mark = &::trued_client_mark;
    static constexpr auto record = &::trued_client_record;
    static constexpr auto process_state = &::trued_client_process_state;
    static constexpr auto measured = &::trued_client_measured;
};
struct monitor_calls {
    using raw = trued_monitor;
    static constexpr auto connect = &::trued_monitor_connect;
    static constexpr auto close = &::trued_monitor_close;
    static constexpr auto connection = &::trued_monitor_connection;
    static constexpr auto next_event = &::trued_monitor_next_event;
    static constexpr auto status = &::trued_monitor_status;
    static constexpr auto vibration = &::trued_monitor_vibration;
    static constexpr auto ping = &::trued_monitor_ping;
    static constexpr auto reload = &::trued_monitor_reload;
    static constexpr auto bypass = &::trued_monitor_bypass;
    static constexpr auto arm = &::trued_monitor_arm;
    static constexpr auto mode = &::trued_monitor_mode;
    static constexpr auto mark = &::trued_monitor_mark;
    static constexpr auto record = &::trued_monitor_record;
    static constexpr auto process_state = &::trued_monitor_process_state;
    static constexpr auto measured = &::trued_monitor_measured;
};
struct instrument_calls {
    using raw = trued_instrument;
    static constexpr auto connect = &::trued_instrument_connect;
    static constexpr auto close = &::trued_instrument_close;
    static constexpr auto connection = &::trued_instrument_connection;
    static constexpr auto next_event = &::trued_instrument_next_event;
};
struct force_calls {
    using raw = trued_force;
    static constexpr auto connect = &::trued_force_connect;
    static constexpr auto close = &::trued_force_close;
    static constexpr auto connection = &::trued_force_connection;
    static constexpr auto next_event = &::trued_force_next_event;
};

// Common to all handles: the connection and its state.
template <typename Calls> class linked {
public:
    trued::connection connection() {
        auto value = made<trued_connection>();
        check(Calls::connection(raw(), &value));
        return value;
    }
    // Events of the connection, oldest first.
    std::optional<trued::connection> next_event() {
        auto value = made<trued_connection>();
        const auto c = Calls::next_event(raw(), &value);
        return found(c, value);
    }

protected:
    linked(const std::string &cell, nanoseconds limit, const char *runtime_dir)
        : handle_(connected<typename Calls::raw, Calls::connect>(cell, limit, runtime_dir)) {}
    typename Calls::raw *raw() const noexcept { return handle_.get(); }

private:
    handle<typename Calls::raw, Calls::close> handle_;
};

// Common to handles that monitor and send requests.
template <typename Calls> class looking : public linked<Calls> {
public:
    std::optional<trued::status> status() {
        auto value = made<trued_status>();
        const auto c = Calls::status(this->raw(), &value);
        return found(c, value);
    }
    // The next verdict not yet taken.
    std::optional<trued::vibration> vibration() {
        auto value = made<trued_vibration>();
        const auto c = Calls::vibration(this->raw(), &value);
        return found(c, value);
    }

    // Requests block within their time limit: do not use them in the robot's loop. A refusal throws, with the daemon's message.
    answer ping(nanoseconds limit) { return asked(Calls::ping, limit); }
    // NULL: the active model, read again.
    answer reload(const char *path, nanoseconds limit) { return asked(Calls::reload, limit, path); }
    answer bypass(bool on, nanoseconds limit) { return asked(Calls::bypass, limit, on ? 1u : 0u); }
    // Changes to shadow mode, or back to the configured mode; refused where that is shadow mode.
    answer arm(bool on, nanoseconds limit) { return asked(Calls::arm, limit, on ? 1u : 0u); }
    // Changes the mode, at most to the one that the configuration allows.
    answer mode(trued::mode to, nanoseconds limit) { return asked(Calls::mode, limit, static_cast<std::uint32_t>(to)); }
    // Writes a marker into the recording.
    answer mark(const std::string &text, nanoseconds limit) { return asked(Calls::mark, limit, text.c_str()); }
    // Starts or stops recording, or marks the present recording to be kept.
    answer record(recorder_action action, nanoseconds limit) {
        return asked(Calls::record, limit, static_cast<std::uint32_t>(action));
    }
    answer process_state(const process &p, nanoseconds limit) { return asked(Calls::process_state, limit, &p); }
    // Reports a measurement of the tool; the answer says whether the model still holds.
    answer tell_measured(const measured &m, nanoseconds limit) { return asked(Calls::measured, limit, &m); }

protected:
    using linked<Calls>::linked;
    template <typename Call, typename... Given> answer asked(Call call, nanoseconds limit, Given... given) {
        auto value = made<trued_answer>();
        check(call(this->raw(), given..., ns(limit), &value));
        return value;
    }
};

} // namespace detail

// The robot's loop: commands out, corrected targets in. One per cell.
class client : public detail::looking<detail::client_calls> {
public:
    explicit client(const std::string &cell, nanoseconds limit, const char *runtime_dir = nullptr)
        : looking(cell, limit, runtime_dir) {}

    // Does not block. If nothing was sent, the reason is returned; the loop continues with target_for().
    sent send(const setpoint &command) {
        sent said{code::ok, 0};
        said.result = detail::gone_on(::trued_client_send(raw(), &command.c(), &said.seq));
        return said;
    }
    template <typename Joints> sent send_joints(const Joints &q) {
        sent said{code::ok, 0};
        said.result =
            detail::gone_on(::trued_client_send_joints(raw(), q.data(), detail::count(q.size()), &said.seq));
        return said;
    }
    code send_state(const robot_state &state) {
        return detail::gone_on(::trued_client_send_state(raw(), &state));
    }
    // Sends the setpoints that follow the next command, in order and one command period apart: call it before send(). `points` is a contiguous container
    // of std::array<double, N>. Of more than TRUED_HORIZON_POINTS_MAX points the first are sent. It replaces the last horizon; an empty one says that
    // no setpoint is known ahead. Does not block. Throws if a number is not finite: nothing was sent then.
    template <typename Points> horizon_sent set_horizon(const Points &points) {
        using point = std::decay_t<decltype(*points.data())>;
        constexpr auto joints = std::tuple_size<point>::value;
        static_assert(std::is_same<point, std::array<double, joints>>::value && sizeof(point) == joints * sizeof(double),
                      "points of std::array<double, N>");
        horizon_sent said{code::ok, 0};
        const double *first = points.size() == 0 ? nullptr : points.data()->data();
        said.result = detail::gone_on(
            ::trued_client_set_horizon(raw(), first, detail::count(joints), detail::count(points.size()), &said.points));
        return said;
    }
    // The joint target to send to the robot for `q_cmd`, whatever the state of the daemon. Does not block. Throws if the command is not finite:
    // the state is then unchanged, and last_target() is the last target sent.
    template <typename Joints> target target_for(const Joints &q_cmd, std::uint64_t now_ns = ::trued_monotonic_ns()) {
        auto value = made<trued_target>();
        detail::check(::trued_client_target(raw(), q_cmd.data(), detail::count(q_cmd.size()), now_ns, &value));
        return value;
    }
    // The last target sent to the robot; empty before the first one.
    std::optional<target> last_target() {
        auto value = made<trued_target>();
        const auto c = ::trued_client_last_target(raw(), &value);
        return detail::found(c, value);
    }
    // Sends and waits within the time limit; in any case returns a target, as target_for() does.
    template <typename Joints> target exchange(const Joints &q_cmd, nanoseconds limit) {
        auto value = made<trued_target>();
        detail::check(::trued_client_exchange(raw(), q_cmd.data(), detail::count(q_cmd.size()),
                                              detail::ns(limit), &value));
        return value;
    }
    // The newest answer of this daemon, however old.
    std::optional<corrected> newest() {
        auto value = made<trued_corrected>();
        const auto c = ::trued_client_newest(raw(), &value);
        return detail::found(c, value);
    }
    // The answer to the command with that number within the time limit; empty if none arrived, with the reason in `why`.
    std::optional<corrected> wait_corrected(std::uint64_t seq, nanoseconds limit, code *why = nullptr) {
        auto value = made<trued_corrected>();
        const code said = detail::gone_on(::trued_client_wait_corrected(raw(), seq, detail::ns(limit), &value));
        if (why != nullptr) *why = said;
        return said == code::ok ? std::optional<corrected>(value) : std::nullopt;
    }
    void set_fresh(nanoseconds fresh) { detail::check(::trued_client_set_fresh(raw(), detail::ns(fresh))); }
    void start_anew() { detail::check(::trued_client_start_anew(raw())); }
    // Starts a new run. The robot is at its command plus this correction, rad or m; without one, at its command: its program was restarted.
    void start_from() { detail::check(::trued_client_start_from(raw(), nullptr, 0)); }
    template <typename Joints> void start_from(const Joints &correction) {
        detail::check(::trued_client_start_from(raw(), correction.data(), detail::count(correction.size())));
    }
};

// Monitors a cell and sends requests to its daemon; any number of processes can do so.
class monitor : public detail::looking<detail::monitor_calls> {
public:
    explicit monitor(const std::string &cell, nanoseconds limit, const char *runtime_dir = nullptr)
        : looking(cell, limit, runtime_dir) {}

    // As reload(), for a model of another robot, or one whose joint limits the arm already exceeds: in shadow mode only.
    answer reload_other_robot(const char *path, nanoseconds limit) {
        return asked(&::trued_monitor_reload_other_robot, limit, path);
    }
};

// Sends force blocks: one source per cell.
class force_source : public detail::linked<detail::force_calls> {
public:
    explicit force_source(const std::string &cell, nanoseconds limit, const char *runtime_dir = nullptr)
        : linked(cell, limit, runtime_dir) {}

    // Sample by sample, `channels` numbers each. A block that cannot be sent is lost and counted; the returned code reports it.
    template <typename Samples>
    code send(std::uint64_t t_ns, double rate_hz, std::uint32_t channels, const Samples &samples, bool in_base = false) {
        using number = std::remove_cv_t<std::remove_pointer_t<decltype(samples.data())>>;
        static_assert(std::is_same_v<number, double> || std::is_same_v<number, float>, "samples are double or float");
        if (channels == 0 || samples.size() % channels != 0) {
            throw error(code::argument, "the number of samples is no multiple of the channels");
        }
        auto block = made<trued_force_samples>();
        block.channels = channels;
        block.count = detail::count(samples.size() / channels);
        block.in_base = in_base ? 1 : 0;
        block.t_ns = t_ns;
        block.rate_hz = rate_hz;
        if constexpr (std::is_same_v<number, double>) {
            block.doubles = samples.data();
        } else {
            block.floats = samples.data();
        }
        return detail::gone_on(::trued_force_send(raw(), &block));
    }
    std::uint64_t lost() {
        std::uint64_t count = 0;
        detail::check(::trued_force_lost(raw(), &count));
        return count;
    }
};

// Sends measured points of the tool: one instrument per cell.
class instrument : public detail::linked<detail::instrument_calls> {
public:
    explicit instrument(const std::string &cell, nanoseconds limit, const char *runtime_dir = nullptr)
        : linked(cell, limit, runtime_dir) {}

    // A point in the instrument's own coordinates, m, measured at `t_ns` of CLOCK_MONOTONIC; 0: the daemon assumes the configured latency.
    // A point that cannot be sent is lost and counted; the returned code reports it.
    code send(const std::array<double, 3> &point_m, std::uint64_t t_ns = 0) {
        return detail::gone_on(::trued_instrument_send(raw(), point_m.data(), t_ns));
    }
    std::uint64_t lost() {
        std::uint64_t count = 0;
        detail::check(::trued_instrument_lost(raw(), &count));
        return count;
    }
};

} // namespace trued

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC diagnostic pop
#endif

#endif // TRUED_HPP
