//! Programs over Catalyst that others wrote, letter by letter as they are in ParaView's source: its
//! examples of Catalyst 2, and the tests of VTK's module CatalystConduit. `scripts/fetch-paraview`
//! puts them into the target directory.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;

use serde_json::{Value, json};
use tombolo_tests::{library, project, succeed};

/// How many cells of one of VTK's types.
type Count = (u8, usize);

/// An example, its program, its last cycle, and what VTK finds in what Tombolo wrote of it on one
/// rank: points and cells. All but one have 70 by 60 by 44 points.
const EXAMPLES: [(&str, &str, u32, usize, &[Count]); 8] = [
    ("CFullExample", "CFullExampleV2", 1, 184_800, &[(12, 175_053)]),
    ("CxxFullExample", "CxxFullExampleV2", 9, 184_800, &[(12, 175_053)]),
    ("CxxImageDataExample", "CxxImageDataExampleV2", 99, 184_800, &[(12, 175_053)]),
    ("CxxMultiChannelInputExample", "CxxMultiChannelInputExampleV2", 9, 184_800, &[(12, 175_053)]),
    ("CxxMultimesh", "CxxMultimeshV2", 9, 184_820, &[(1, 20), (12, 175_053)]),
    ("CxxPolygonal", "CxxPolygonal", 9, 4_200, &[(9, 4_071)]),
    ("CxxPolyhedra", "CxxPolyhedraV2", 9, 184_800, &[(42, 175_053)]),
    ("CxxSteeringExample", "CxxSteeringExample", 9, 184_800, &[(12, 175_053)]),
];

/// The libraries of VTK that its module calls.
const VTK: [&str; 8] = [
    "CommonCore",
    "CommonDataModel",
    "CommonExecutionModel",
    "CommonMath",
    "CommonSystem",
    "FiltersCore",
    "loguru",
    "sys",
];

/// ParaView's source, as it was fetched.
fn source() -> PathBuf {
    let target = std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| project().join("target"), PathBuf::from);
    let source = target.join("third-party/paraview-5.11.0+dfsg");
    assert!(
        source.join("complete").exists(),
        "{} is missing: run scripts/fetch-paraview",
        source.display()
    );
    source
}

/// A folder of these tests, and in it a prefix with everything.
fn folder() -> &'static Path {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join("paraview");
        let mut install = Command::new(project().join("scripts/install-catalyst"));
        install.arg(folder.join("prefix")).arg("--library").arg(library("libcatalyst.so"));
        succeed(install.arg("--implementation").arg(library("libtombolo_catalyst.so")));
        folder
    })
}

#[test]
fn examples_run_as_they_are_on_one_rank_and_on_two() {
    let (source, folder) = (source().join("Examples/Catalyst2"), folder());
    let prefix = folder.join("prefix");
    for (example, program, last, points, cells) in EXAMPLES {
        let build = folder.join(example);
        // CMake refuses what another clone left.
        drop(fs::remove_dir_all(&build));
        let mut configure = Command::new("cmake");
        configure.arg("-S").arg(source.join(example)).arg("-B").arg(&build);
        succeed(
            configure
                .arg(format!("-DCMAKE_PREFIX_PATH={}", prefix.display()))
                .arg("-DBUILD_TESTING=OFF"),
        );
        succeed(Command::new("cmake").arg("--build").arg(&build));
        for ranks in [1, 2] {
            let written = tempfile::tempdir().expect("a folder");
            let pipelines = written.path().join("pipelines.json");
            let write = json!({"write": {"file": "mesh-{cycle}.vtu"}});
            let pipeline = json!({"name": "files", "every": {"steps": last}, "stages": [write]});
            fs::write(&pipelines, json!({"version": 1, "pipelines": [pipeline]}).to_string())
                .expect("a file");
            let mut run = Command::new("mpirun");
            run.args(["--oversubscribe", "--allow-run-as-root", "-n", &ranks.to_string()]);
            run.arg(build.join("bin").join(program)).current_dir(written.path());
            for variable in [
                "TOMBOLO_ORDERS",
                "TOMBOLO_OUTPUT",
                "TOMBOLO_REPORT",
                "CATALYST_DATA_DUMP_DIRECTORY",
            ] {
                run.env_remove(variable);
            }
            // They ask for ParaView by name.
            run.env("CATALYST_IMPLEMENTATION_PREFER_ENV", "1")
                .env("CATALYST_IMPLEMENTATION_NAME", "tombolo");
            run.env("CATALYST_IMPLEMENTATION_PATHS", prefix.join("lib/catalyst"));
            let told = succeed(run.env("TOMBOLO_PIPELINES", &pipelines));
            assert!(
                !told.contains("Failed") && !told.contains("ERROR"),
                "{example} on {ranks}: {told}"
            );
            let file = written.path().join(format!("mesh-{last:06}.vtu"));
            let mut read = Command::new("/usr/bin/python3");
            let read = succeed(read.arg(project().join("tests/vtk/counts.py")).arg(&file));
            let found: Value = serde_json::from_str(&read)
                .unwrap_or_else(|error| panic!("{example}: {error}\n{read}"));
            // Points of their own are on each rank; what ranks share is there once.
            let more = if example == "CxxMultimesh" { 20 * (ranks - 1) } else { 0 };
            let count = |&(kind, count): &(u8, usize)| {
                (kind.to_string(), json!(count + if kind == 1 { more } else { 0 }))
            };
            let cells: serde_json::Map<String, Value> = cells.iter().map(count).collect();
            let expected = json!({"points": points + more, "cells": cells, "arrays": [["velocity"], ["pressure"]]});
            assert_eq!(found, expected, "{example} on {ranks}");
        }
    }
}

#[test]
fn the_tests_of_vtk_itself_pass() {
    let (source, prefix) = (source(), folder().join("prefix"));
    let (module, ours) =
        (source.join("VTK/IO/CatalystConduit"), project().join("catalyst-compat/tests/paraview"));
    let build = tempfile::tempdir().expect("a folder");
    let files = [
        module.join("vtkConduitArrayUtilities.cxx"),
        module.join("vtkConduitSource.cxx"),
        module.join("vtkDataObjectToConduit.cxx"),
        module.join("Testing/Cxx/TestConduitSource.cxx"),
        module.join("Testing/Cxx/TestDataObjectToConduit.cxx"),
        ours.join("main.cpp"),
    ];
    let mut link = Command::new("g++");
    for (index, file) in files.iter().enumerate() {
        let object = build.path().join(format!("{index}.o"));
        let mut compile = Command::new("g++");
        compile.args(["-std=c++11", "-w", "-c"]).arg(file).arg("-o").arg(&object);
        for headers in
            [&ours, &module, &source.join("vtk-headers"), &prefix.join("include/catalyst-2.0")]
        {
            compile.arg("-I").arg(headers);
        }
        succeed(compile.args(["-include", "later_vtk.h"]));
        link.arg(object);
    }
    let program = build.path().join("tests");
    link.arg("-o").arg(&program).args(VTK.map(|name| format!("-l:libvtk{name}-9.1.so.1")));
    link.arg("-L")
        .arg(prefix.join("lib"))
        .arg("-lcatalyst")
        .arg(format!("-Wl,-rpath,{}/lib", prefix.display()));
    succeed(&mut link);
    for test in ["source", "object"] {
        let told = succeed(Command::new(&program).arg(test));
        assert!(!told.contains("ERR|"), "{test}: {told}");
    }
}
