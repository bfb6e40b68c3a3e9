//! Validated handles: a handle is an index into a table, never dereferenced.
//!
//! Promise: a handle that was closed, never was one, or is in use by another thread is an error without side effects, and no
//! call waits for another.

use std::sync::{Mutex, TryLockError};

use crate::code::Fault;

/// Most handles of one kind.
const SLOTS: usize = 64;
/// A handle's number: generation, slot, kind, from the top.
const SLOT_AT: u32 = 8;
const GENERATION_AT: u32 = 16;
const BYTE: usize = 0xff;

/// All handles of one kind.
pub(crate) struct Handles<T> {
    kind: usize,
    slots: [Mutex<Slot<T>>; SLOTS],
}

struct Slot<T> {
    generation: usize,
    value: Option<Box<T>>,
}

impl<T> Handles<T> {
    /// An empty table; `kind` is above zero, so that no handle is NULL.
    pub(crate) const fn new(kind: usize) -> Self {
        Self { kind, slots: [const { Mutex::new(Slot { generation: 0, value: None }) }; SLOTS] }
    }

    /// Keeps the value; answers its handle.
    pub(crate) fn open(&self, value: T) -> Result<usize, Fault> {
        for (i, slot) in self.slots.iter().enumerate() {
            let Ok(mut slot) = slot.try_lock() else { continue };
            if slot.value.is_none() {
                slot.generation += 1;
                slot.value = Some(Box::new(value));
                return Ok(slot.generation << GENERATION_AT | i << SLOT_AT | self.kind);
            }
        }
        Err(Fault::TooMany(SLOTS))
    }

    /// Does something with the value.
    pub(crate) fn with<R>(
        &self,
        handle: usize,
        act: impl FnOnce(&mut T) -> Result<R, Fault>,
    ) -> Result<R, Fault> {
        let slot = self.slot(handle)?;
        let mut slot = slot.try_lock().map_err(|e| match e {
            TryLockError::WouldBlock => Fault::Busy,
            TryLockError::Poisoned(_) => Fault::Broken,
        })?;
        let Slot { generation, value } = &mut *slot;
        match value {
            Some(value) if *generation == handle >> GENERATION_AT => act(value),
            _ => Err(Fault::Closed),
        }
    }

    /// Gives the value up; dropped by the caller, outside of the lock.
    pub(crate) fn close(&self, handle: usize) -> Result<Box<T>, Fault> {
        let slot = self.slot(handle)?;
        let taken = match slot.try_lock() {
            Ok(mut slot) if slot.generation == handle >> GENERATION_AT => slot.value.take(),
            Ok(_) => None,
            Err(TryLockError::WouldBlock) => return Err(Fault::Busy),
            Err(TryLockError::Poisoned(broken)) => {
                let value = broken.into_inner().value.take();
                slot.clear_poison();
                value
            }
        };
        taken.ok_or(Fault::Closed)
    }

    fn slot(&self, handle: usize) -> Result<&Mutex<Slot<T>>, Fault> {
        if handle & BYTE != self.kind {
            return Err(Fault::Closed);
        }
        self.slots.get(handle >> SLOT_AT & BYTE).ok_or(Fault::Closed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::code::guard;
    use crate::trued_code;

    #[test]
    fn a_closed_handle_stays_closed_when_its_slot_is_used_again() {
        static TABLE: Handles<u32> = Handles::new(1);
        let first = TABLE.open(5).unwrap();
        assert_eq!(TABLE.with(first, |value| Ok(*value)).unwrap(), 5);
        assert_eq!(*TABLE.close(first).unwrap(), 5);
        let second = TABLE.open(6).unwrap();
        assert_ne!(first, second);
        assert!(matches!(TABLE.with(first, |value| Ok(*value)), Err(Fault::Closed)));
        assert!(matches!(TABLE.close(first), Err(Fault::Closed)));
        assert_eq!(TABLE.with(second, |value| Ok(*value)).unwrap(), 6);
    }

    #[test]
    fn what_never_was_a_handle_is_closed() {
        static TABLE: Handles<u32> = Handles::new(1);
        for number in [0, 1, 2, 0xff01, 0x1_0002, usize::MAX, 0xdead_beef] {
            assert!(matches!(TABLE.with(number, |_| Ok(())), Err(Fault::Closed)), "{number:x}");
        }
    }

    #[test]
    fn a_second_thread_is_told_and_not_made_to_wait() {
        static TABLE: Handles<u32> = Handles::new(1);
        let handle = TABLE.open(0).unwrap();
        let inner = TABLE.with(handle, |_| {
            let other = std::thread::spawn(move || {
                (TABLE.with(handle, |_| Ok(())), TABLE.close(handle).is_err())
            });
            Ok(other.join().unwrap())
        });
        assert!(matches!(inner, Ok((Err(Fault::Busy), true))));
        assert!(TABLE.close(handle).is_ok());
    }

    #[test]
    fn a_handle_that_panicked_says_so_until_it_is_closed() {
        static TABLE: Handles<u32> = Handles::new(1);
        let handle = TABLE.open(0).unwrap();
        let code = guard(|| TABLE.with(handle, |_| panic!("inside")));
        assert_eq!(code, trued_code::TRUED_ERROR_INTERNAL);
        assert!(matches!(TABLE.with(handle, |_| Ok(())), Err(Fault::Broken)));
        assert!(TABLE.close(handle).is_ok());
        assert!(matches!(TABLE.with(handle, |_| Ok(())), Err(Fault::Closed)));
        assert!(TABLE.open(1).is_ok());
    }

    #[test]
    fn too_many_handles_are_refused_and_one_closed_makes_room() {
        static TABLE: Handles<u32> = Handles::new(1);
        let all: Vec<usize> = (0..64).map(|_| TABLE.open(0).unwrap()).collect();
        assert!(matches!(TABLE.open(0), Err(Fault::TooMany(64))));
        TABLE.close(all[7]).unwrap();
        assert!(TABLE.open(0).is_ok());
    }
}
