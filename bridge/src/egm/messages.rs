//! The EGM messages that the bridge reads and writes.
//!
//! After the messages of ABB's Application manual EGM (3HAC073318-001), in both variants in use: a
//! force can be in field 1, or as field 2 behind a flag. Angles are in degrees and lengths in mm
//! here, as in the datagram.
//!
//! No allocation; other fields are neither checked nor changed.

use trued_client::JOINTS_MAX;

use super::wire::{DecodeError, Field, Fields, Value, Writer};

/// `EgmHeader.mtype` of a target.
pub const CORRECTION: u32 = 3;
/// `EgmHeader.mtype` of a path correction.
pub const PATH_CORRECTION: u32 = 4;
/// `EgmMCIState` of a robot that is being guided.
pub const MCI_RUNNING: u32 = 3;
/// `EgmMCIState` after a fault.
pub const MCI_ERROR: u32 = 1;
/// `EgmMCIState` of a robot that is not being guided.
pub const MCI_STOPPED: u32 = 2;

/// `EgmHeader`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Header {
    /// Increases with each message of its sender.
    pub seqno: Option<u32>,
    /// The sender's clock, ms.
    pub tm: Option<u32>,
    /// Kind of message.
    pub mtype: Option<u32>,
}

/// Numbers of a message with their positions in the datagram.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointValues {
    values: [f64; JOINTS_MAX],
    places: [usize; JOINTS_MAX],
    count: usize,
}

impl Default for JointValues {
    fn default() -> Self {
        Self { values: [0.0; JOINTS_MAX], places: [0; JOINTS_MAX], count: 0 }
    }
}

impl JointValues {
    fn push(&mut self, value: f64, offset: usize) -> Result<(), DecodeError> {
        let places = self.values.get_mut(self.count).zip(self.places.get_mut(self.count));
        let (to, place) = places.ok_or(DecodeError::TooManyJoints)?;
        (*to, *place) = (value, offset);
        self.count += 1;
        Ok(())
    }

    /// The numbers.
    #[must_use]
    pub fn values(&self) -> &[f64] {
        &self.values[..self.count]
    }

    /// Replaces these numbers; nothing else of the datagram changes.
    pub fn write(&self, datagram: &mut [u8], values: &[f64]) {
        for (offset, value) in self.places[..self.count].iter().zip(values) {
            if let Some(place) = datagram.get_mut(*offset..offset + 8) {
                place.copy_from_slice(&value.to_le_bytes());
            }
        }
    }
}

/// Joint positions in one message, degrees.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Posture {
    /// The robot's axes.
    pub joints: JointValues,
    /// External axes; the seventh of a seven-axis robot is the first of them.
    pub external: JointValues,
    /// Whether there is also, or only, a pose.
    pub has_pose: bool,
}

/// The used part of `EgmRobot`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct RobotMessage {
    /// Number and clock.
    pub header: Header,
    /// Measured position.
    pub feedback: Posture,
    /// Position planned by its program.
    pub planned: Posture,
    /// State of the motion, if stated.
    pub mci_state: Option<u32>,
    /// Measured force, N, and moment, Nm, if stated and not marked as inactive.
    pub force: Force,
}

/// `EgmMeasuredForce` in either layout.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Force {
    /// `fcActive`, if stated.
    pub is_active: Option<bool>,
    /// Fx Fy Fz Mx My Mz, N and Nm.
    pub values: JointValues,
}

/// The used part of `EgmSensor`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct SensorMessage {
    /// Number and kind.
    pub header: Header,
    /// The target.
    pub planned: Posture,
    /// Whether there is also, or only, a speed reference (`speedRef`, deg/s). It is never changed.
    pub has_speed: bool,
}

/// `EgmSensorPathCorr`.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct PathCorrMessage {
    /// Number and kind.
    pub header: Header,
    /// x, y, z in the path's frame, mm, with their positions; all three or none.
    pub offset: Option<Offset>,
}

/// Three numbers with their positions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Offset {
    /// x, y, z, mm.
    pub mm: [f64; 3],
    places: [usize; 3],
}

impl Offset {
    /// Replaces this offset.
    pub fn put(&self, datagram: &mut [u8], mm: [f64; 3]) {
        for (offset, value) in self.places.iter().zip(mm) {
            if let Some(place) = datagram.get_mut(*offset..offset + 8) {
                place.copy_from_slice(&value.to_le_bytes());
            }
        }
    }
}

impl Header {
    fn read(&mut self, mut fields: Fields<'_>) -> Result<(), DecodeError> {
        while let Some(field) = fields.next()? {
            match field.number {
                1 => self.seqno = Some(field.uint32()?),
                2 => self.tm = Some(field.uint32()?),
                3 => self.mtype = Some(field.uint32()?),
                _ => {}
            }
        }
        Ok(())
    }
}

fn joints(numbers: &mut JointValues, field: &Field<'_>) -> Result<(), DecodeError> {
    let mut fields = field.message()?;
    while let Some(field) = fields.next()? {
        if field.number == 1 {
            field.doubles(|value, offset| numbers.push(value, offset))?;
        }
    }
    Ok(())
}

impl Posture {
    /// Whether it holds neither joints nor a pose.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.joints.values().is_empty() && self.external.values().is_empty() && !self.has_pose
    }

    /// `EgmPlanned` and `EgmFeedBack` have the same fields.
    fn read(&mut self, mut fields: Fields<'_>) -> Result<(), DecodeError> {
        while let Some(field) = fields.next()? {
            match field.number {
                1 => joints(&mut self.joints, &field)?,
                2 => self.has_pose = true,
                3 => joints(&mut self.external, &field)?,
                _ => {}
            }
        }
        Ok(())
    }
}

impl Force {
    fn read(&mut self, mut fields: Fields<'_>) -> Result<(), DecodeError> {
        while let Some(field) = fields.next()? {
            match (field.number, field.value) {
                (1, Value::Varint(flag)) => self.is_active = Some(flag != 0),
                (1 | 2, _) => field.doubles(|value, offset| self.values.push(value, offset))?,
                _ => {}
            }
        }
        Ok(())
    }

    /// The six components, if they are complete and force control is active.
    #[must_use]
    pub fn wrench(&self) -> Option<[f64; 6]> {
        let six = self.values.values().try_into().ok()?;
        (self.is_active != Some(false)).then_some(six)
    }
}

impl RobotMessage {
    /// Reads a datagram of the controller.
    ///
    /// # Errors
    /// It is not an `EgmRobot`.
    pub fn read(datagram: &[u8]) -> Result<Self, DecodeError> {
        let (mut message, mut fields) = (Self::default(), Fields::new(datagram));
        while let Some(field) = fields.next()? {
            match field.number {
                1 => message.header.read(field.message()?)?,
                2 => message.feedback.read(field.message()?)?,
                3 => message.planned.read(field.message()?)?,
                5 => {
                    let mut fields = field.message()?;
                    while let Some(field) = fields.next()? {
                        if field.number == 1 {
                            message.mci_state = Some(field.uint32()?);
                        }
                    }
                }
                9 => message.force.read(field.message()?)?,
                _ => {}
            }
        }
        Ok(message)
    }
}

impl SensorMessage {
    /// Reads a datagram of the application.
    ///
    /// # Errors
    /// It is not an `EgmSensor`.
    pub fn read(datagram: &[u8]) -> Result<Self, DecodeError> {
        let (mut message, mut fields) = (Self::default(), Fields::new(datagram));
        while let Some(field) = fields.next()? {
            match field.number {
                1 => message.header.read(field.message()?)?,
                2 => message.planned.read(field.message()?)?,
                3 => message.has_speed = true,
                _ => {}
            }
        }
        Ok(message)
    }
}

impl PathCorrMessage {
    /// Reads a datagram of the application.
    ///
    /// # Errors
    /// It is not an `EgmSensorPathCorr`.
    pub fn read(datagram: &[u8]) -> Result<Self, DecodeError> {
        let (mut header, mut fields) = (Header::default(), Fields::new(datagram));
        let mut found = [None; 3];
        while let Some(field) = fields.next()? {
            match field.number {
                1 => header.read(field.message()?)?,
                2 => {
                    let mut fields = field.message()?;
                    while let Some(field) = fields.next()? {
                        if field.number == 1 {
                            cartesian(&mut found, field.message()?)?;
                        }
                    }
                }
                _ => {}
            }
        }
        let offset = match found {
            [Some(x), Some(y), Some(z)] => {
                Some(Offset { mm: [x.0, y.0, z.0], places: [x.1, y.1, z.1] })
            }
            _ => None,
        };
        Ok(Self { header, offset })
    }

    /// Writes a message of the bridge: `offset_mm` in the path's frame, seen `age_ms` ago. Returns
    /// its length; `None` if `to` is too short.
    pub fn write(to: &mut [u8], header: Header, offset_mm: [f64; 3], age_ms: u32) -> Option<usize> {
        let mut writer = Writer::new(to);
        writer.message(1, |writer| {
            let numbers = [(1, header.seqno), (2, header.tm), (3, header.mtype)];
            for (field, number) in numbers {
                if let Some(number) = number {
                    writer.varint(field, u64::from(number));
                }
            }
        });
        writer.message(2, |writer| {
            writer.message(1, |writer| {
                for (field, value) in (1..).zip(offset_mm) {
                    writer.double(field, value);
                }
            });
            writer.varint(2, u64::from(age_ms));
        });
        writer.finish()
    }
}

fn cartesian(
    found: &mut [Option<(f64, usize)>; 3],
    mut fields: Fields<'_>,
) -> Result<(), DecodeError> {
    while let Some(field) = fields.next()? {
        if let Some(place) = (field.number as usize).checked_sub(1).and_then(|i| found.get_mut(i)) {
            *place = Some(field.double()?);
        }
    }
    Ok(())
}
