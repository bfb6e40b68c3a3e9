//! Files in and out: models, recordings, mappings, cell configuration, the black box.
