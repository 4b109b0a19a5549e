//! Meshes of the Blueprint, read from nodes: no value of an array is looked at.

mod amr;
mod channel;
mod coordset;
mod domain;
mod field;
mod rows;
mod topology;

pub(crate) use channel::{has_blocks, read};
