//! A drop-in `libcatalyst.so.3`: the Catalyst 2 API with its loader and stub, Conduit's node behind its C interface, and
//! Blueprint's checks, in Rust and with no library behind it but the C library.
//!
//! Solvers that were written for Catalyst 2 link to it unchanged; `scripts/install-catalyst PREFIX` puts the library, its headers
//! (C, C++, Fortran), its Python packages, its CMake package and its pkg-config files into a prefix.
//!
//! # Guarantees
//! - The shared library exports exactly the names in `symbols.txt`.
//! - A null node, a number out of range, a path that is not there, a length that is negative: each is told to the error handler,
//!   with the node's path, what was found and what was expected; a value read as another type is told to the handler of warnings.
//! - No panic leaves a function. Where no handler is set an error is thrown as a C++ `std::runtime_error`, if the process has a
//!   C++ runtime; else it is printed and the function returns 0 or null.
//!
//! # What it does not
//! An address that is not a node, an array that is shorter than it is said to be, and two threads that use one tree at once are
//! not noticed.
//!
//! # Where it differs
//! - Messages are in other words than Conduit's, and name the place. Blueprint's reports have the same `valid`, `errors` and `info`.
//! - In YAML a quoted number is a text, `null` holds nothing, and `!!str` makes a text.
//! - Blueprint wants `sizes` and `offsets` for elements of mixed shapes; components of a field have one length.
//! - What `conduit_blueprint_mesh_partition` makes is unstructured, whatever it cut, and joins only points that are equal.
//! - Names that release candidates of Catalyst 2 had (`catalyst_error`, `catalyst_library` of CMake) are not there, nor is the C++
//!   interface of Conduit itself (`conduit::Node`): `conduit_cpp::Node` is.

pub mod base64;
pub mod blueprint;
mod c_api;
mod children;
pub mod compare;
pub mod datatype;
pub mod dump;
pub mod error;
pub mod files;
pub mod implementation;
pub mod information;
pub mod json;
pub mod leaf;
pub mod loader;
pub mod memory;
pub mod node;
pub mod print;
pub mod ranks;
pub mod schema;
pub mod stub;
pub mod transfer;
pub mod yaml;
