//! Classification of the application's datagrams, depending on the type of guidance.

use recording::bridge::Guidance;

use super::messages::{CORRECTION, Header, PathCorrMessage, Posture, SensorMessage};

/// A target of the application that may be answered.
#[expect(clippy::large_enum_variant, reason = "a box would be a heap under the loop")]
#[derive(Debug, Clone, Copy)]
pub enum ClassifiedTarget {
    /// A joint target.
    Joints {
        /// The target read.
        planned: Posture,
        /// Whether it is a repetition.
        is_repeated: bool,
    },
    /// An offset across a path.
    Offset(PathCorrMessage),
    /// A speed reference without a position: it is not corrected.
    SpeedOnly,
    /// Any other message: it is forwarded unchanged.
    Unchanged,
}

/// Classifies the application's datagram by the type of guidance; `None` if it is not valid.
pub(super) fn classify(guidance: Guidance, datagram: &[u8]) -> Option<(Header, ClassifiedTarget)> {
    if guidance == Guidance::Path {
        let message = PathCorrMessage::read(datagram).ok()?;
        let offset = message.offset?;
        let is_good = offset.mm.iter().all(|mm| mm.is_finite());
        return is_good.then_some((message.header, ClassifiedTarget::Offset(message)));
    }
    let message = SensorMessage::read(datagram).ok()?;
    let joints = message.planned.joints.values().iter().chain(message.planned.external.values());
    if !joints.clone().all(|degrees| degrees.is_finite()) {
        return None;
    }
    let is_target = message.header.mtype.is_none_or(|mtype| mtype == CORRECTION);
    let is_joints = is_target && !message.planned.joints.values().is_empty();
    let screened = if is_joints && !message.planned.has_pose {
        ClassifiedTarget::Joints { planned: message.planned, is_repeated: false }
    } else if is_target && message.has_speed && message.planned.is_empty() {
        ClassifiedTarget::SpeedOnly
    } else {
        ClassifiedTarget::Unchanged
    };
    Some((message.header, screened))
}
