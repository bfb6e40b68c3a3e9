//! The standard ROS 2 messages that a recording is converted to, with their definitions.
//!
//! Fields and their order: `common_interfaces` and `rcl_interfaces` of ROS 2 (Jazzy). Encoding: CDR as in [`crate::mcap_recording`].

use crate::mcap_recording::cdr::{CdrWriter, Field};

/// A message of ROS 2.
pub(super) trait RosMessage {
    /// Its type.
    const NAME: &'static str;
    /// Its definition and those of the messages in it, as a container's `ros2msg` schema has them.
    const DEFINITION: &'static str;
    fn put(&self, out: &mut CdrWriter);
}

/// A time, ns since 1970.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Time(pub(super) u64);

impl Time {
    fn put(self, out: &mut CdrWriter) {
        i32::try_from(self.0 / 1_000_000_000).unwrap_or(i32::MAX).put(out);
        ((self.0 % 1_000_000_000) as u32).put(out);
    }
}

/// Time stamp and frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Header<'a> {
    pub(super) stamp: Time,
    pub(super) frame: &'a str,
}

impl Header<'_> {
    fn put(&self, out: &mut CdrWriter) {
        self.stamp.put(out);
        put_text(self.frame, out);
    }
}

fn put_text(text: &str, out: &mut CdrWriter) {
    text.to_owned().put(out);
}

fn put_count(count: usize, out: &mut CdrWriter) {
    u32::try_from(count).unwrap_or(u32::MAX).put(out);
}

fn put_numbers(numbers: &[f64], out: &mut CdrWriter) {
    numbers.iter().for_each(|number| number.put(out));
}

macro_rules! with_header {
    ($text:literal $(, $more:literal)*) => {
        concat!(
            "std_msgs/Header header\n", $text,
            $("================\n", $more,)*
            "================\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n",
            "================\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n",
        )
    };
}

/// Joints; a list is empty if nothing is known.
#[derive(Debug)]
pub(super) struct JointState<'a> {
    pub(super) header: Header<'a>,
    pub(super) names: &'a [String],
    /// rad or m.
    pub(super) position: &'a [f64],
    /// N m or N.
    pub(super) effort: &'a [f64],
}

impl RosMessage for JointState<'_> {
    const NAME: &'static str = "sensor_msgs/msg/JointState";
    const DEFINITION: &'static str =
        with_header!("string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n");

    fn put(&self, out: &mut CdrWriter) {
        self.header.put(out);
        put_count(self.names.len(), out);
        self.names.iter().for_each(|name| put_text(name, out));
        self.position.to_vec().put(out);
        Vec::<f64>::new().put(out);
        self.effort.to_vec().put(out);
    }
}

/// Force and moment, N and N m.
#[derive(Debug)]
pub(super) struct WrenchStamped<'a> {
    pub(super) header: Header<'a>,
    pub(super) wrench: [f64; 6],
}

impl RosMessage for WrenchStamped<'_> {
    const NAME: &'static str = "geometry_msgs/msg/WrenchStamped";
    const DEFINITION: &'static str = with_header!(
        "geometry_msgs/Wrench wrench\n",
        "MSG: geometry_msgs/Wrench\ngeometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
        "MSG: geometry_msgs/Vector3\nfloat64 x\nfloat64 y\nfloat64 z\n"
    );

    fn put(&self, out: &mut CdrWriter) {
        self.header.put(out);
        put_numbers(&self.wrench, out);
    }
}

/// A point, m.
#[derive(Debug)]
pub(super) struct PointStamped<'a> {
    pub(super) header: Header<'a>,
    pub(super) point: [f64; 3],
}

impl RosMessage for PointStamped<'_> {
    const NAME: &'static str = "geometry_msgs/msg/PointStamped";
    const DEFINITION: &'static str = with_header!(
        "geometry_msgs/Point point\n",
        "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n"
    );

    fn put(&self, out: &mut CdrWriter) {
        self.header.put(out);
        put_numbers(&self.point, out);
    }
}

/// A pose: m, and a unit quaternion x, y, z, w.
#[derive(Debug)]
pub(super) struct PoseStamped<'a> {
    pub(super) header: Header<'a>,
    pub(super) position: [f64; 3],
    pub(super) orientation_xyzw: [f64; 4],
}

impl RosMessage for PoseStamped<'_> {
    const NAME: &'static str = "geometry_msgs/msg/PoseStamped";
    const DEFINITION: &'static str = with_header!(
        "geometry_msgs/Pose pose\n",
        "MSG: geometry_msgs/Pose\ngeometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
        "MSG: geometry_msgs/Point\nfloat64 x\nfloat64 y\nfloat64 z\n",
        "MSG: geometry_msgs/Quaternion\nfloat64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"
    );

    fn put(&self, out: &mut CdrWriter) {
        self.header.put(out);
        put_numbers(&self.position, out);
        put_numbers(&self.orientation_xyzw, out);
    }
}

/// A temperature, °C; its variance is unknown, which the message represents by 0.
#[derive(Debug)]
pub(super) struct Temperature<'a> {
    pub(super) header: Header<'a>,
    pub(super) celsius: f64,
}

impl RosMessage for Temperature<'_> {
    const NAME: &'static str = "sensor_msgs/msg/Temperature";
    const DEFINITION: &'static str = with_header!("float64 temperature\nfloat64 variance\n");

    fn put(&self, out: &mut CdrWriter) {
        self.header.put(out);
        put_numbers(&[self.celsius, 0.0], out);
    }
}

/// State of a component.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    Ok = 0,
    Warn = 1,
    Error = 2,
}

/// The state of one component, with values as text.
#[derive(Debug)]
pub(super) struct DiagnosticArray<'a> {
    pub(super) header: Header<'a>,
    pub(super) level: Level,
    pub(super) name: &'a str,
    pub(super) message: &'a str,
    pub(super) hardware: &'a str,
    pub(super) values: &'a [(&'static str, String)],
}

impl RosMessage for DiagnosticArray<'_> {
    const NAME: &'static str = "diagnostic_msgs/msg/DiagnosticArray";
    const DEFINITION: &'static str = with_header!(
        "diagnostic_msgs/DiagnosticStatus[] status\n",
        "MSG: diagnostic_msgs/DiagnosticStatus\nbyte level\nstring name\nstring message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values\n",
        "MSG: diagnostic_msgs/KeyValue\nstring key\nstring value\n"
    );

    fn put(&self, out: &mut CdrWriter) {
        self.header.put(out);
        put_count(1, out);
        (self.level as u8).put(out);
        put_text(self.name, out);
        put_text(self.message, out);
        put_text(self.hardware, out);
        put_count(self.values.len(), out);
        for (key, value) in self.values {
            put_text(key, out);
            put_text(value, out);
        }
    }
}

/// A line of a log.
#[derive(Debug)]
pub(super) struct Log<'a> {
    pub(super) stamp: Time,
    /// 20: information, 30: warning, 40: error.
    pub(super) level: u8,
    pub(super) name: &'a str,
    pub(super) message: &'a str,
}

impl RosMessage for Log<'_> {
    const NAME: &'static str = "rcl_interfaces/msg/Log";
    const DEFINITION: &'static str = concat!(
        "builtin_interfaces/Time stamp\nuint8 level\nstring name\nstring msg\nstring file\nstring function\nuint32 line\n",
        "================\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n",
    );

    fn put(&self, out: &mut CdrWriter) {
        self.stamp.put(out);
        self.level.put(out);
        for text in [self.name, self.message, "", ""] {
            put_text(text, out);
        }
        0_u32.put(out);
    }
}
