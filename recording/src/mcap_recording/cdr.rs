//! CDR serialisation of the messages, as read by ROS 2 tools (little endian, XCDR1).
//!
//! Contract: OMG CDR, plain; alignment counts from the end of the four-byte header. Reading never
//! panics and never takes more memory than the input has bytes.

const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// Writes values in sequence.
#[derive(Debug, Default)]
pub(crate) struct CdrWriter {
    bytes: Vec<u8>,
}

impl CdrWriter {
    /// Begins a message and reuses the buffer.
    pub(crate) fn begin(&mut self) {
        self.bytes.clear();
        self.bytes.extend(LITTLE_ENDIAN);
    }

    pub(crate) fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn align(&mut self, to: usize) {
        let past = (self.bytes.len() - LITTLE_ENDIAN.len()) % to;
        let missing = if past == 0 { 0 } else { to - past };
        self.bytes.extend(std::iter::repeat_n(0, missing));
    }
}

/// Reads values in sequence; `None` at the end of the input or for an invalid value.
#[derive(Debug)]
pub(crate) struct CdrReader<'b> {
    bytes: &'b [u8],
    offset: usize,
}

impl<'b> CdrReader<'b> {
    pub(crate) fn new(message: &'b [u8]) -> Option<Self> {
        let bytes = message.strip_prefix(&LITTLE_ENDIAN)?;
        Some(Self { bytes, offset: 0 })
    }

    /// Whether the message ends here; fields that later versions added are then missing.
    pub(crate) fn is_at_end(&self) -> bool {
        self.offset >= self.bytes.len()
    }

    fn take(&mut self, count: usize, align: usize) -> Option<&'b [u8]> {
        let start = self.offset.checked_next_multiple_of(align)?;
        let end = start.checked_add(count)?;
        let taken = self.bytes.get(start..end)?;
        self.offset = end;
        Some(taken)
    }
}

/// A value that a message may hold.
pub(crate) trait Field: Sized {
    /// Its type in a `ros2msg` definition.
    const TYPE: &'static str;
    fn put(&self, out: &mut CdrWriter);
    fn get(from: &mut CdrReader<'_>) -> Option<Self>;
}

macro_rules! plain {
    ($($rust:ty = $name:literal),+) => {$(
        impl Field for $rust {
            const TYPE: &'static str = $name;
            fn put(&self, out: &mut CdrWriter) {
                out.align(size_of::<$rust>());
                out.bytes.extend(self.to_le_bytes());
            }
            fn get(from: &mut CdrReader<'_>) -> Option<Self> {
                let bytes = from.take(size_of::<$rust>(), size_of::<$rust>())?;
                Some(Self::from_le_bytes(bytes.try_into().ok()?))
            }
        }
    )+};
}

plain!(u8 = "uint8", i32 = "int32", u32 = "uint32", u64 = "uint64", f64 = "float64");

impl Field for String {
    const TYPE: &'static str = "string";

    fn put(&self, out: &mut CdrWriter) {
        // A NUL byte inside would end the string early for other readers.
        let clean: Vec<u8> = self.bytes().filter(|byte| *byte != 0).collect();
        (u32::try_from(clean.len()).unwrap_or(u32::MAX - 1) + 1).put(out);
        out.bytes.extend(clean);
        out.bytes.push(0);
    }

    fn get(from: &mut CdrReader<'_>) -> Option<Self> {
        let length = usize::try_from(u32::get(from)?).ok()?;
        let bytes = from.take(length, 1)?;
        let bytes = bytes.strip_suffix(&[0]).unwrap_or(bytes);
        Some(String::from_utf8_lossy(bytes).into_owned())
    }
}

impl Field for Vec<f64> {
    const TYPE: &'static str = "float64[]";

    fn put(&self, out: &mut CdrWriter) {
        put_numbers(self, out);
    }

    fn get(from: &mut CdrReader<'_>) -> Option<Self> {
        let count = usize::try_from(u32::get(from)?).ok()?;
        if count == 0 {
            return Some(Self::new());
        }
        let bytes = from.take(count.checked_mul(8)?, 8)?;
        let (numbers, _) = bytes.as_chunks::<8>();
        Some(numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect())
    }
}

fn put_numbers(numbers: &[f64], out: &mut CdrWriter) {
    u32::try_from(numbers.len()).unwrap_or(u32::MAX).put(out);
    if !numbers.is_empty() {
        out.align(8);
        numbers.iter().for_each(|number| out.bytes.extend(number.to_le_bytes()));
    }
}

/// Up to `N` numbers without heap allocation, for records in a ring buffer.
#[derive(Debug, Clone, Copy)]
pub struct InlineVec<const N: usize> {
    count: usize,
    values: [f64; N],
}

impl<const N: usize> InlineVec<N> {
    /// Empty: the values are unknown.
    pub const EMPTY: Self = Self { count: 0, values: [0.0; N] };

    /// The first `N` numbers of a slice.
    #[must_use]
    pub fn from_slice(values: &[f64]) -> Self {
        let mut few = Self::EMPTY;
        few.count = values.len().min(N);
        few.values[..few.count].copy_from_slice(&values[..few.count]);
        few
    }

    /// The numbers.
    #[must_use]
    pub fn as_slice(&self) -> &[f64] {
        &self.values[..self.count]
    }
}

impl<const N: usize> Default for InlineVec<N> {
    fn default() -> Self {
        Self::EMPTY
    }
}

impl<const N: usize> PartialEq for InlineVec<N> {
    fn eq(&self, other: &Self) -> bool {
        self.as_slice() == other.as_slice()
    }
}

impl<const N: usize> Field for InlineVec<N> {
    const TYPE: &'static str = "float64[]";

    fn put(&self, out: &mut CdrWriter) {
        put_numbers(self.as_slice(), out);
    }

    fn get(from: &mut CdrReader<'_>) -> Option<Self> {
        let numbers = Vec::get(from)?;
        (numbers.len() <= N).then(|| Self::from_slice(&numbers))
    }
}
