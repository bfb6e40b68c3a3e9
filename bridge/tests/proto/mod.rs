//! EGM's messages for `prost`: written by hand from the fields and numbers of ABB's manual
//! (3HAC073318-001), in both forms of a measured force. Complete, to make messages; and
//! [`partial`], the part that the bridge reads, to judge invalid ones.
#![allow(
    missing_docs,
    unreachable_pub,
    dead_code,
    reason = "names of a foreign protocol, some for one test only"
)]

use prost::Message;

/// A message whose fields are all optional.
macro_rules! of_messages {
    ($($(#[$doc:meta])* $name:ident { $($tag:tt $field:ident: $of:ty,)* })*) => {
        $($(#[$doc])*
        #[derive(Clone, PartialEq, Message)]
        pub struct $name {
            $(#[prost(message, optional, tag = $tag)] pub $field: Option<$of>,)*
        })*
    };
}

of_messages! {
    Pose { "1" pos: Cartesian, "2" orient: Quaternion, }
    /// `EgmPlanned` and `EgmFeedBack`.
    Posture { "1" joints: Joints, "2" cartesian: Pose, "3" external: Joints, "4" time: Clock, }
    SpeedRef { "1" joints: Joints, }
    SensorPathCorr { "1" header: Header, "2" path_corr: PathCorr, }
}

#[derive(Clone, PartialEq, Message)]
pub struct Header {
    #[prost(uint32, optional, tag = "1")]
    pub seqno: Option<u32>,
    #[prost(uint32, optional, tag = "2")]
    pub tm: Option<u32>,
    #[prost(int32, optional, tag = "3")]
    pub mtype: Option<i32>,
}

#[derive(Clone, PartialEq, Message)]
pub struct Cartesian {
    #[prost(double, required, tag = "1")]
    pub x: f64,
    #[prost(double, required, tag = "2")]
    pub y: f64,
    #[prost(double, required, tag = "3")]
    pub z: f64,
}

#[derive(Clone, PartialEq, Message)]
pub struct Quaternion {
    #[prost(double, required, tag = "1")]
    pub u0: f64,
    #[prost(double, required, tag = "2")]
    pub u1: f64,
    #[prost(double, required, tag = "3")]
    pub u2: f64,
    #[prost(double, required, tag = "4")]
    pub u3: f64,
}

/// Not packed, as proto2 writes it.
#[derive(Clone, PartialEq, Message)]
pub struct Joints {
    #[prost(double, repeated, packed = "false", tag = "1")]
    pub joints: Vec<f64>,
}

#[derive(Clone, PartialEq, Message)]
pub struct PackedJoints {
    #[prost(double, repeated, packed = "true", tag = "1")]
    pub joints: Vec<f64>,
}

#[derive(Clone, PartialEq, Message)]
pub struct Clock {
    #[prost(uint64, required, tag = "1")]
    pub sec: u64,
    #[prost(uint64, required, tag = "2")]
    pub usec: u64,
}

#[derive(Clone, PartialEq, Message)]
pub struct State {
    #[prost(int32, required, tag = "1")]
    pub state: i32,
}

/// The newer layout.
#[derive(Clone, PartialEq, Message)]
pub struct Force {
    #[prost(bool, optional, tag = "1")]
    pub is_active: Option<bool>,
    #[prost(double, repeated, packed = "false", tag = "2")]
    pub force: Vec<f64>,
}

/// The older layout.
#[derive(Clone, PartialEq, Message)]
pub struct OldForce {
    #[prost(double, repeated, packed = "false", tag = "1")]
    pub force: Vec<f64>,
}

macro_rules! robot {
    ($name:ident, $force:ty) => {
        #[derive(Clone, PartialEq, Message)]
        pub struct $name {
            #[prost(message, optional, tag = "1")]
            pub header: Option<Header>,
            #[prost(message, optional, tag = "2")]
            pub feedback: Option<Posture>,
            #[prost(message, optional, tag = "3")]
            pub planned: Option<Posture>,
            #[prost(message, optional, tag = "4")]
            pub motor_state: Option<State>,
            #[prost(message, optional, tag = "5")]
            pub mci_state: Option<State>,
            #[prost(bool, optional, tag = "6")]
            pub mci_convergence_met: Option<bool>,
            #[prost(message, optional, tag = "8")]
            pub rapid_state: Option<State>,
            #[prost(message, optional, tag = "9")]
            pub force: Option<$force>,
            #[prost(double, optional, tag = "10")]
            pub utilization_rate: Option<f64>,
            #[prost(uint32, optional, tag = "11")]
            pub move_index: Option<u32>,
        }
    };
}
robot!(Robot, Force);
robot!(OldRobot, OldForce);

#[derive(Clone, PartialEq, Message)]
pub struct Sensor {
    #[prost(message, optional, tag = "1")]
    pub header: Option<Header>,
    #[prost(message, optional, tag = "2")]
    pub planned: Option<Posture>,
    #[prost(message, optional, tag = "3")]
    pub speed_ref: Option<SpeedRef>,
    /// A field of a later version.
    #[prost(string, optional, tag = "99")]
    pub later: Option<String>,
}

#[derive(Clone, PartialEq, Message)]
pub struct PathCorr {
    #[prost(message, optional, tag = "1")]
    pub pos: Option<Cartesian>,
    #[prost(uint32, required, tag = "2")]
    pub age: u32,
}

/// The part that the bridge reads: other fields are not validated.
pub mod partial {
    use super::{Header, Joints, Message, State};

    of_messages! {
        Posture { "1" joints: Joints, "3" external: Joints, }
        Robot { "1" header: Header, "2" feedback: Posture, "3" planned: Posture, "5" mci_state: State, }
        Sensor { "1" header: Header, "2" planned: Posture, }
    }
}
