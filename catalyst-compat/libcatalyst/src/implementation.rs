//! An implementation of Catalyst: its functions, and the outcomes of their calls.

use std::ffi::c_int;

use crate::node::Node;

/// The outcome of a call, numbered as Catalyst numbers it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[repr(i32)]
pub enum Status {
    /// Done.
    Ok = 0,
    /// Nothing has been initialized.
    NoImplementation = 1,
    /// Another implementation is loaded.
    AlreadyLoaded = 2,
    /// No library of the name was found.
    NotFound = 3,
    /// The library is no implementation of Catalyst.
    NotCatalyst = 4,
    /// The implementation lacks a function.
    Incomplete = 5,
    /// The implementation is of another version.
    UnsupportedVersion = 6,
    /// The implementation uses another Conduit.
    ConduitMismatch = 7,
}

/// A function of an implementation that reads a node.
pub type Call = unsafe extern "C-unwind" fn(*const Node) -> c_int;
/// A function of an implementation that fills a node.
pub type CallMut = unsafe extern "C-unwind" fn(*mut Node) -> c_int;

/// The table that an implementation exports as `catalyst_api_impl`.
#[derive(Debug, Clone, Copy)]
#[repr(C)]
pub struct Table {
    /// The version of the table: 1.
    pub version: c_int,
    /// `catalyst_initialize`.
    pub initialize: Option<Call>,
    /// `catalyst_execute`.
    pub execute: Option<Call>,
    /// `catalyst_finalize`.
    pub finalize: Option<Call>,
    /// `catalyst_about`.
    pub about: Option<CallMut>,
    /// `catalyst_results`.
    pub results: Option<CallMut>,
}

/// An implementation with all its functions.
#[derive(Debug, Clone, Copy)]
pub struct Implementation {
    /// `catalyst_initialize`.
    pub initialize: Call,
    /// `catalyst_execute`.
    pub execute: Call,
    /// `catalyst_finalize`.
    pub finalize: Call,
    /// `catalyst_about`.
    pub about: CallMut,
    /// `catalyst_results`.
    pub results: CallMut,
}
