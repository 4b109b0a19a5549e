//! What the book says is true: its JSON is accepted, its links lead somewhere.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value;
use tombolo_deform::edit::{Edit, Editor};
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::shapes::box_of_tets;
use tombolo_deform::surface::Surface;
use tombolo_pipelines::files::read_displacements;
use tombolo_pipelines::language::{
    Command, LanguageError, Validate, parse, parse_json, parse_orders, resolve_files,
};
use tombolo_tests::project;

fn pages() -> Vec<PathBuf> {
    let mut pages: Vec<PathBuf> = fs::read_dir(project().join("docs"))
        .expect("docs/ is there")
        .map(|entry| entry.expect("docs/ can be read").path())
        .filter(|path| path.extension().is_some_and(|extension| extension == "md"))
        .collect();
    pages.extend(["README.md", "CONTRIBUTING.md", "CHANGELOG.md"].map(|page| project().join(page)));
    pages.sort();
    pages
}

/// The fenced blocks of a language, with the line each starts at.
fn blocks(text: &str, language: &str) -> Vec<(usize, String)> {
    let mut found = Vec::new();
    let mut current: Option<(usize, bool, String)> = None;
    for (number, line) in text.lines().enumerate() {
        match (&mut current, line.trim_start().strip_prefix("```")) {
            (None, Some(name)) => current = Some((number + 2, name == language, String::new())),
            (Some(_), Some(_)) => {
                if let Some((start, true, block)) = current.take() {
                    found.push((start, block));
                }
            }
            (Some((_, _, block)), None) => {
                block.push_str(line);
                block.push('\n');
            }
            (None, None) => {}
        }
    }
    found
}

/// Reads a snippet as what it looks like: a configuration, a list of edits, or commands as viewers
/// and files of orders say them.
fn accept(block: &str, name: &str) -> Result<(), LanguageError> {
    let value: Value = parse_json(block, name)?;
    let first = value.get(0).unwrap_or(&value);
    if value.get("version").is_some() {
        return parse(block, name).map(drop);
    }
    let is_command = ["order", "pipelines"].iter().any(|key| first.get(key).is_some());
    if !is_command && value.is_array() {
        return parse_json::<Vec<Edit>>(block, name).map(drop);
    }
    parse_orders(block, name).map(drop)
}

#[test]
fn json_of_the_book_is_accepted() {
    let mut checked = 0;
    for page in pages() {
        let text = fs::read_to_string(&page).expect("a page can be read");
        for (line, block) in blocks(&text, "json") {
            if let Err(error) = accept(&block, "snippet") {
                panic!("{}:{line}: {error}", page.display());
            }
            checked += 1;
        }
    }
    assert!(checked > 0, "the book has no JSON");
}

/// Every list of edits of the page on edits does something to the bar it speaks of.
#[test]
fn edits_of_the_book_are_carried_out() {
    let text = fs::read_to_string(project().join("docs/edits.md")).expect("the page is there");
    let folder = tempfile::tempdir().expect("a folder");
    let (_, table) = blocks(&text, "text").swap_remove(0);
    fs::write(folder.path().join("lift.txt"), table).expect("a file");
    let list = folder.path().join("edits.json").to_string_lossy().into_owned();

    let mesh = box_of_tets([16, 4, 4], [0.0; 3], [4.0, 1.0, 1.0]);
    let surface =
        Arc::new(Surface::extract(&mesh, &FeatureSettings::default()).expect("a surface"));
    let mut editor = Editor::new(Arc::clone(&surface)).expect("an editor");
    let mut kinds = BTreeSet::new();
    for (line, block) in blocks(&text, "json") {
        let mut edits = match parse_json::<Vec<Edit>>(&block, "snippet") {
            Ok(edits) => edits,
            Err(_) => match parse_orders(&block, "snippet")
                .expect("edits or orders")
                .swap_remove(0)
                .command
            {
                Command::Order(order) => order.edits().to_vec(),
                other => panic!("docs/edits.md:{line}: {other:?} brings no edits"),
            },
        };
        kinds.extend(edits.iter().map(Edit::name));
        if edits.iter().any(|edit| matches!(edit, Edit::Skeleton(_))) {
            // A bar of a few faces has no skeleton to speak of.
            edits.validate().expect("a valid edit");
            continue;
        }
        resolve_files(&mut edits, &list);
        read_displacements(&mut edits, &surface)
            .unwrap_or_else(|error| panic!("docs/edits.md:{line}: {error}"));
        let displacement = editor
            .displacement(&edits)
            .unwrap_or_else(|error| panic!("docs/edits.md:{line}: {error}"));
        let largest =
            displacement.iter().flatten().fold(0.0_f64, |largest, part| largest.max(part.abs()));
        assert!(largest > 0.03 && largest < 2.0, "docs/edits.md:{line}: {largest}");
    }
    assert_eq!(kinds.len(), 7, "{kinds:?}");
}

/// Lines without their indentation, empty ones left out.
fn dense(text: &str) -> Vec<&str> {
    text.lines().map(str::trim).filter(|line| !line.is_empty()).collect()
}

/// What the book shows of other languages is cut out of programs that are built and run.
#[test]
fn snippets_of_other_languages_are_of_the_examples() {
    let read = |folder: &str| -> Vec<String> {
        let files =
            fs::read_dir(project().join("examples").join(folder)).expect("the examples are there");
        files
            .map(|file| fs::read_to_string(file.expect("a file").path()).expect("a text"))
            .collect()
    };
    let mut checked = 0;
    for (language, folder) in [("c", "heat/c"), ("cpp", "heat/cxx"), ("fortran", "heat/fortran")] {
        let programs = read(folder);
        for page in pages() {
            let text = fs::read_to_string(&page).expect("a page can be read");
            for (line, block) in blocks(&text, language) {
                let wanted = dense(&block);
                let found = programs.iter().any(|program| {
                    dense(program).windows(wanted.len()).any(|lines| lines == wanted)
                });
                assert!(
                    found,
                    "{}:{line}: no example in {folder} has these lines:\n{block}",
                    page.display()
                );
                checked += 1;
            }
        }
    }
    assert!(checked >= 10, "{checked} snippets");
}

#[test]
fn what_is_wrong_in_a_snippet_is_found() {
    for wrong in [
        r#"{"version": 1, "pipelnes": []}"#,
        r#"[{"translate": {"by": [1, 0]}}]"#,
        r#"[{"order": {"undo": "all"}}]"#,
    ] {
        assert!(accept(wrong, "snippet").is_err(), "{wrong}");
    }
}

#[test]
fn links_of_the_book_lead_somewhere() {
    for page in pages() {
        let text = fs::read_to_string(&page).expect("a page can be read");
        for target in text.split("](").skip(1).filter_map(|rest| rest.split(')').next()) {
            if target.starts_with("http") || target.starts_with('#') || target.contains(' ') {
                continue;
            }
            let file = target.split('#').next().unwrap_or(target);
            let path = page.parent().unwrap_or(Path::new(".")).join(file);
            assert!(path.exists(), "{}: '{target}' leads nowhere", page.display());
        }
    }
}
