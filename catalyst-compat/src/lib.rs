//! Catalyst 2 compatibility: the C interface of Tombolo.
