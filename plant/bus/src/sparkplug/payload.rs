//! The part of Sparkplug B's payload that this bridge writes and reads, as protobuf messages.
//!
//! Field numbers and types are those of the Eclipse Sparkplug Specification 3.0.0, section 6.4 (`org.eclipse.tahu.protobuf.Payload`); fields that are not used here are left out: protobuf readers skip them.

use prost::{Message, Oneof};

/// A message.
#[derive(Clone, PartialEq, Message)]
pub struct Payload {
    /// When it was sent, ms since 1970-01-01 UTC.
    #[prost(uint64, optional, tag = "1")]
    pub timestamp: Option<u64>,
    /// Its metrics.
    #[prost(message, repeated, tag = "2")]
    pub metrics: Vec<Metric>,
    /// Counts the messages of a node, 0 to 255; none in NDEATH and in commands.
    #[prost(uint64, optional, tag = "3")]
    pub seq: Option<u64>,
}

/// A named value.
#[derive(Clone, PartialEq, Message)]
pub struct Metric {
    /// Its name.
    #[prost(string, optional, tag = "1")]
    pub name: Option<String>,
    /// When it had this value, ms since 1970-01-01 UTC.
    #[prost(uint64, optional, tag = "3")]
    pub timestamp: Option<u64>,
    /// Code of [`DataType`].
    #[prost(uint32, optional, tag = "4")]
    pub datatype: Option<u32>,
    /// Whether it is of the past, and not the present value.
    #[prost(bool, optional, tag = "5")]
    pub is_historical: Option<bool>,
    /// Whether it has no value.
    #[prost(bool, optional, tag = "7")]
    pub is_null: Option<bool>,
    /// The value.
    #[prost(oneof = "Value", tags = "11, 13, 14, 15")]
    pub value: Option<Value>,
}

/// A value.
#[derive(Clone, PartialEq, Oneof)]
pub enum Value {
    /// Of [`DataType::Int64`].
    #[prost(uint64, tag = "11")]
    Long(u64),
    /// Of [`DataType::Double`].
    #[prost(double, tag = "13")]
    Double(f64),
    /// Of [`DataType::Boolean`].
    #[prost(bool, tag = "14")]
    Boolean(bool),
    /// Of [`DataType::String`].
    #[prost(string, tag = "15")]
    String(String),
}

/// Types of values that are used here, with Sparkplug's codes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DataType {
    /// 64-bit integer with sign.
    Int64 = 4,
    /// Floating-point number, 64 bit.
    Double = 10,
    /// True or false.
    Boolean = 11,
    /// Text in UTF-8.
    String = 12,
}
