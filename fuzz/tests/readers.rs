//! A short pass of each reader, which begins with its corpus.

use std::{path::Path, time::Duration};

use tombolo_fuzz::{Target, fuzz};

fn passes(target: Target) {
    let corpus =
        Path::new(env!("CARGO_MANIFEST_DIR")).join(format!("corpus/{}.zst", target.name()));
    assert!(corpus.is_file(), "there is no {}", corpus.display());
    let folder = tempfile::tempdir().unwrap();
    match fuzz(target, 1, Duration::from_secs(3), folder.path(), false) {
        Ok(pass) => assert!(pass.inputs > 10 && pass.outcomes > 2, "{pass:?}"),
        Err(fault) => {
            // Where it outlives the test.
            let file = folder.keep().join(fault.file.file_name().unwrap_or_default());
            panic!("{}: {}", file.display(), fault.reason);
        }
    }
}

macro_rules! readers {
    ($($name:ident: $target:ident,)*) => {$(
        #[test]
        fn $name() {
            passes(Target::$target);
        }
    )*};
}

readers! {
    orders: Orders,
    messages: Messages,
    frames: Frames,
    pipelines: Pipelines,
    journals: Journal,
    recordings: Recordings,
    checkpoints: Checkpoints,
    links: Links,
    events: Events,
    answers: Answers,
    playback: Playback,
    attach: Attach,
    relayed: Relayed,
    msh: Msh,
    vtu: Vtu,
    vtp: Vtp,
    vtk: Vtk,
    displacements: Displacements,
}
