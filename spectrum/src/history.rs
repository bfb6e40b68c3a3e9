//! Ring buffer of the newest samples of one channel, always contiguous.
//!
//! Every sample is written twice, half a buffer apart, so that any number of the newest samples is
//! a contiguous slice. Execution does not allocate.

/// A ring buffer whose newest samples can be borrowed as one slice.
#[derive(Debug)]
pub(crate) struct History {
    mirror: Vec<f64>,
    capacity: usize,
    next: usize,
    filled: usize,
}

impl History {
    /// A buffer of the newest `capacity` samples (at least one).
    pub(crate) fn new(capacity: usize) -> Self {
        let capacity = capacity.max(1);
        Self { mirror: vec![0.0; 2 * capacity], capacity, next: 0, filled: 0 }
    }

    /// Adds one sample.
    #[inline]
    pub(crate) fn push(&mut self, sample: f64) {
        self.mirror[self.next] = sample;
        self.mirror[self.next + self.capacity] = sample;
        self.next += 1;
        if self.next == self.capacity {
            self.next = 0;
        }
        self.filled = (self.filled + 1).min(self.capacity);
    }

    /// The newest `n` samples, oldest first; `None` if there are fewer.
    #[inline]
    pub(crate) fn newest(&self, n: usize) -> Option<&[f64]> {
        if n > self.filled {
            return None;
        }
        let end = self.next + self.capacity;
        Some(&self.mirror[end - n..end])
    }

    /// Removes all samples.
    pub(crate) fn clear(&mut self) {
        self.filled = 0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_newest_run_is_whole_at_every_turn_of_the_ring() {
        let mut history = History::new(5);
        assert!(history.newest(1).is_none());
        for i in 0..23 {
            history.push(f64::from(i));
            let n = (i as usize + 1).min(5);
            let run: Vec<f64> = (i + 1 - n as i32..=i).map(f64::from).collect();
            assert_eq!(history.newest(n), Some(&run[..]));
        }
        history.clear();
        assert!(history.newest(1).is_none());
    }
}
