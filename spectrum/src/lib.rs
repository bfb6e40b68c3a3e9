//! Windows, transforms, floors, peaks and verdicts on vibration.
