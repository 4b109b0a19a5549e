//! Blueprint's part of the C interface.

use std::ffi::{c_char, c_int};

use super::{node, node_mut, run, string};
use crate::blueprint::mcarray::{self, Arrangement};
use crate::blueprint::{self, MESH_PARTS, PROTOCOLS};
use crate::error::Result;
use crate::node::Node;

/// Verifies, and hands the report over when the tree is not borrowed any more.
///
/// # Safety
/// As the functions of [`super`].
unsafe fn verify(protocol: &str, source: *const Node, info: *mut Node) -> Result<c_int> {
    let mut report = Node::new();
    // SAFETY: as the caller promises.
    unsafe {
        let valid = blueprint::verify(protocol, node(source)?, &mut report)?;
        node_mut(info)?.take(report)?;
        Ok(valid.into())
    }
}

macro_rules! verifiers {
    ($($name:literal: $protocol:literal;)*) => { $(
        const _: () = {
            #[unsafe(export_name = concat!("catalyst_conduit_blueprint_", $name, "_verify"))]
            unsafe extern "C-unwind" fn whole(source: *const Node, info: *mut Node) -> c_int {
                // SAFETY: the caller keeps to `c_api`'s rules.
                run(0, || unsafe { verify($protocol, source, info) })
            }

            #[unsafe(export_name = concat!("catalyst_conduit_blueprint_", $name, "_verify_sub_protocol"))]
            unsafe extern "C-unwind" fn part(protocol: *const c_char, source: *const Node, info: *mut Node) -> c_int {
                run(0, || {
                    // SAFETY: the caller keeps to `c_api`'s rules.
                    unsafe { verify(&format!("{}/{}", $protocol, string(protocol, "the protocol")?), source, info) }
                })
            }
        };
    )* };
}
verifiers! { "mesh": "mesh"; "mcarray": "mcarray"; "table": "table"; }

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_blueprint_verify(
    protocol: *const c_char,
    source: *const Node,
    info: *mut Node,
) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(0, || unsafe { verify(&string(protocol, "the protocol")?, source, info) })
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_blueprint_about(target: *mut Node) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules.
        let target = unsafe { node_mut(target)? };
        target.reset();
        let protocols = target.at("protocols")?;
        for part in MESH_PARTS {
            protocols.at("mesh")?.child_named(part)?.set_text("enabled")?;
        }
        for protocol in PROTOCOLS.into_iter().filter(|protocol| *protocol != "mesh") {
            protocols.child_named(protocol)?.set_text("enabled")?;
        }
        Ok(())
    });
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_blueprint_mcarray_is_interleaved(
    source: *const Node,
) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    run(0, || Ok(mcarray::is_interleaved(unsafe { node(source)? }).into()))
}

/// # Safety
/// As the functions of [`super`].
unsafe fn arrange(source: *const Node, target: *mut Node, arrangement: Arrangement) -> c_int {
    run(0, || {
        // SAFETY: the caller keeps to `c_api`'s rules; the copy is made before the target is borrowed.
        unsafe {
            match mcarray::arranged(node(source)?, arrangement)? {
                Some(copy) => node_mut(target)?.take(copy).map(|()| 1),
                None => Ok(0),
            }
        }
    })
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_blueprint_mcarray_to_contiguous(
    source: *const Node,
    target: *mut Node,
) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { arrange(source, target, Arrangement::Contiguous) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_blueprint_mcarray_to_interleaved(
    source: *const Node,
    target: *mut Node,
) -> c_int {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { arrange(source, target, Arrangement::Interleaved) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_blueprint_mesh_generate_index(
    mesh: *const Node,
    path: *const c_char,
    domains: i64,
    index: *mut Node,
) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules; the index is built before the target is borrowed.
        unsafe {
            let made =
                blueprint::index::generate(node(mesh)?, &string(path, "the path")?, domains)?;
            node_mut(index)?.take(made)
        }
    });
}

/// # Safety
/// As the functions of [`super`].
unsafe fn transform(
    mesh: *const Node,
    options: *const Node,
    target: *mut Node,
    how: fn(&Node, &Node) -> Result<Node>,
) {
    run((), || {
        // SAFETY: the caller keeps to `c_api`'s rules; the output is built before the target is borrowed.
        unsafe {
            let none = Node::new();
            let made = how(node(mesh)?, options.as_ref().unwrap_or(&none))?;
            node_mut(target)?.take(made)
        }
    });
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_blueprint_mesh_partition(
    mesh: *const Node,
    options: *const Node,
    output: *mut Node,
) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { transform(mesh, options, output, blueprint::partition::partition) }
}

#[unsafe(no_mangle)]
unsafe extern "C-unwind" fn catalyst_conduit_blueprint_mesh_flatten(
    mesh: *const Node,
    options: *const Node,
    output: *mut Node,
) {
    // SAFETY: the caller keeps to `c_api`'s rules.
    unsafe { transform(mesh, options, output, blueprint::flatten::flatten) }
}
