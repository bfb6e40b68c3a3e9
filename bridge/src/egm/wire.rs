//! In-place decoding of Protocol Buffers: iterates over the fields of a byte slice.
//!
//! No allocation, no panic on any bytes, and the same decision as `prost` on well-formed messages
//! (`tests/egm_wire.rs`), except that groups, which no EGM message has, are refused. A value knows
//! its position in the datagram, so that a number can be changed in place while every other byte
//! stays unchanged. Messages are never copied.

/// The datagram is not a valid message of this kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum DecodeError {
    /// It ends within a field.
    #[error("the message ends within a field")]
    Truncated,
    /// A tag, or a number, that Protocol Buffers do not define.
    #[error("invalid tag or number")]
    InvalidTag,
    /// A field has another type than the protocol states.
    #[error("field {number} has the invalid wire type {wire_type}")]
    WrongType {
        /// Number of the field.
        number: u32,
        /// Its wire type.
        wire_type: u8,
    },
    /// More joints than any robot has.
    #[error("more than {} joints", trued_client::JOINTS_MAX)]
    TooManyJoints,
}

/// Bits of a tag that hold the wire type.
const TYPE_BITS: u32 = 3;
/// Bytes of the longest number.
const VARINT_MAX: usize = 10;

/// A field's value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Value<'a> {
    /// A varint.
    Varint(u64),
    /// A 64-bit value.
    Fixed64([u8; 8]),
    /// A 32-bit value.
    Fixed32,
    /// A message, a string, or packed numbers.
    Bytes(&'a [u8]),
}

/// A field and the position of its value in the datagram.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Field<'a> {
    pub(crate) number: u32,
    pub(crate) value: Value<'a>,
    pub(crate) offset: usize,
}

/// The fields of a message.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Fields<'a> {
    rest: &'a [u8],
    /// Position of `rest` in the datagram.
    offset: usize,
}

impl<'a> Fields<'a> {
    /// The fields of a whole datagram.
    pub(crate) fn new(datagram: &'a [u8]) -> Self {
        Self { rest: datagram, offset: 0 }
    }

    /// The next field; `None` at the end.
    pub(crate) fn next(&mut self) -> Result<Option<Field<'a>>, DecodeError> {
        if self.rest.is_empty() {
            return Ok(None);
        }
        let tag = u32::try_from(self.varint()?).map_err(|_| DecodeError::InvalidTag)?;
        let (number, wire_type) = (tag >> TYPE_BITS, tag & ((1 << TYPE_BITS) - 1));
        if number == 0 {
            return Err(DecodeError::InvalidTag);
        }
        let mut offset = self.offset;
        let value = match wire_type {
            0 => Value::Varint(self.varint()?),
            1 => Value::Fixed64(self.array()?),
            2 => {
                let length = usize::try_from(self.varint()?).map_err(|_| DecodeError::Truncated)?;
                offset = self.offset;
                Value::Bytes(self.take(length)?)
            }
            5 => {
                self.array::<4>()?;
                Value::Fixed32
            }
            _ => return Err(DecodeError::WrongType { number, wire_type: wire_type as u8 }),
        };
        Ok(Some(Field { number, value, offset }))
    }

    fn take(&mut self, length: usize) -> Result<&'a [u8], DecodeError> {
        let (head, rest) = self.rest.split_at_checked(length).ok_or(DecodeError::Truncated)?;
        self.rest = rest;
        self.offset += length;
        Ok(head)
    }

    fn array<const N: usize>(&mut self) -> Result<[u8; N], DecodeError> {
        self.take(N)?.try_into().map_err(|_| DecodeError::Truncated)
    }

    fn varint(&mut self) -> Result<u64, DecodeError> {
        let mut number = 0_u64;
        for i in 0..VARINT_MAX {
            let [byte] = self.array::<1>()?;
            // The tenth byte has room for one bit.
            if i == VARINT_MAX - 1 && byte > 1 {
                return Err(DecodeError::InvalidTag);
            }
            number |= u64::from(byte & 0x7f) << (7 * i);
            if byte & 0x80 == 0 {
                return Ok(number);
            }
        }
        Err(DecodeError::InvalidTag)
    }
}

impl<'a> Field<'a> {
    fn wire_type(&self) -> u8 {
        match self.value {
            Value::Varint(_) => 0,
            Value::Fixed64(_) => 1,
            Value::Bytes(_) => 2,
            Value::Fixed32 => 5,
        }
    }

    fn wrong_type<T>(&self) -> Result<T, DecodeError> {
        Err(DecodeError::WrongType { number: self.number, wire_type: self.wire_type() })
    }

    /// A varint.
    pub(crate) fn varint(&self) -> Result<u64, DecodeError> {
        if let Value::Varint(number) = self.value { Ok(number) } else { self.wrong_type() }
    }

    /// A `uint32`; longer values are truncated, as usual.
    pub(crate) fn uint32(&self) -> Result<u32, DecodeError> {
        Ok(self.varint()? as u32)
    }

    /// An embedded message.
    pub(crate) fn message(&self) -> Result<Fields<'a>, DecodeError> {
        match self.value {
            Value::Bytes(bytes) => Ok(Fields { rest: bytes, offset: self.offset }),
            _ => self.wrong_type(),
        }
    }

    /// A `double`, and its position.
    pub(crate) fn double(&self) -> Result<(f64, usize), DecodeError> {
        if let Value::Fixed64(bytes) = self.value {
            Ok((f64::from_le_bytes(bytes), self.offset))
        } else {
            self.wrong_type()
        }
    }

    /// Elements of a `repeated double`, one at a time or packed, each with its position.
    pub(crate) fn doubles(
        &self,
        mut each: impl FnMut(f64, usize) -> Result<(), DecodeError>,
    ) -> Result<(), DecodeError> {
        let Value::Bytes(packed) = self.value else {
            let (value, offset) = self.double()?;
            return each(value, offset);
        };
        let (chunks, rest) = packed.as_chunks::<8>();
        for (i, chunk) in chunks.iter().enumerate() {
            each(f64::from_le_bytes(*chunk), self.offset + 8 * i)?;
        }
        if rest.is_empty() { Ok(()) } else { Err(DecodeError::Truncated) }
    }
}

/// Writes a message into a slice; what does not fit is omitted, which `finish` reports.
#[derive(Debug)]
pub(crate) struct Writer<'a> {
    to: &'a mut [u8],
    length: usize,
    full: bool,
}

impl<'a> Writer<'a> {
    pub(crate) fn new(to: &'a mut [u8]) -> Self {
        Self { to, length: 0, full: false }
    }

    /// The length written; `None` if it did not fit.
    pub(crate) fn finish(self) -> Option<usize> {
        (!self.full).then_some(self.length)
    }

    fn byte(&mut self, byte: u8) {
        match self.to.get_mut(self.length) {
            Some(place) => {
                *place = byte;
                self.length += 1;
            }
            None => self.full = true,
        }
    }

    fn number(&mut self, mut number: u64) {
        while number >= 0x80 {
            self.byte((number as u8 & 0x7f) | 0x80);
            number >>= 7;
        }
        self.byte(number as u8);
    }

    pub(crate) fn varint(&mut self, field: u32, number: u64) {
        self.number(u64::from(field << TYPE_BITS));
        self.number(number);
    }

    pub(crate) fn double(&mut self, field: u32, value: f64) {
        self.number(u64::from(field << TYPE_BITS | 1));
        for byte in value.to_le_bytes() {
            self.byte(byte);
        }
    }

    /// An embedded message of at most 127 bytes.
    pub(crate) fn message(&mut self, field: u32, write: impl FnOnce(&mut Self)) {
        self.number(u64::from(field << TYPE_BITS | 2));
        let place = self.length;
        self.byte(0);
        write(self);
        let length = self.length.saturating_sub(place + 1);
        match (u8::try_from(length), self.to.get_mut(place)) {
            (Ok(length), Some(byte)) if length < 0x80 => *byte = length,
            _ => self.full = true,
        }
    }
}
