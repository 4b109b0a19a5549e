//! A file system that hangs.

use std::{fs::File, path::Path, process::Command};

use tombolo_pipelines::language::Existing;

use super::*;

fn row(path: &Path, cycle: u64) -> Job {
    let titles = vec!["drop".into()];
    let table = Table { file: "a.csv".into(), titles, existing: Existing::Replace };
    let content = Content::Row(Arc::new(table), cycle, vec![1.0]);
    Job { pipeline: "drop".into(), path: path.into(), time: 0.1, content }
}

/// A pipe that nobody reads holds whoever opens it to write.
#[test]
fn a_disk_that_hangs_holds_the_solver_for_a_stated_time() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.csv");
    assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
    let mut writer = Writer::default();
    let begun = Instant::now();
    // One is being written and two wait.
    for cycle in 0..3 {
        writer.write(row(&path, cycle));
    }
    while begun.elapsed() < Duration::from_secs(20) && writer.faults().is_empty() {
        writer.write(row(&path, 3));
    }
    // It is not waited for again.
    let later = Instant::now();
    (4..100).for_each(|cycle| writer.write(row(&path, cycle)));
    assert!(later.elapsed() < 10 * PATIENCE, "{:?}", later.elapsed());
    let faults = writer.finish();
    assert!(begun.elapsed() < 30 * PATIENCE, "{:?}", begun.elapsed());
    assert!(faults[0].contains("a.csv: it was not written: the disk"), "{faults:?}");
    assert!(faults.last().unwrap().starts_with("the last files were not written"), "{faults:?}");
    // Lets the thread go on to its end.
    drop(File::open(&path).unwrap());
}
