//! Tables of monitors: CSV files that grow by a row at a time.

use std::fmt::Write as _;
use std::fs::{File, OpenOptions, create_dir_all};
use std::io::{BufRead as _, BufReader, Seek as _, SeekFrom, Write as _};
use std::path::Path;

use tombolo_pipelines::{language::Existing, run::Table};

/// A table that is open.
pub(crate) struct OpenTable {
    file: File,
    /// Whether the last row could not be written.
    is_failing: bool,
}

/// Bytes of a first line that are looked at.
const FIRST_LINE: u64 = 1 << 22;

impl OpenTable {
    /// Opens or begins the file.
    ///
    /// # Errors
    /// Why it cannot be written, or what other columns it has.
    pub(crate) fn open(path: &Path, table: &Table) -> Result<Self, String> {
        let told = |error: std::io::Error| format!("{}: {error}", path.display());
        if let Some(folder) = path.parent() {
            create_dir_all(folder).map_err(told)?;
        }
        let head = head(&table.titles);
        if table.existing == Existing::Continue && path.exists() {
            let mut file = OpenOptions::new().read(true).append(true).open(path).map_err(told)?;
            let mut found = String::new();
            let mut lines = BufReader::new(std::io::Read::take(&file, FIRST_LINE));
            lines.read_line(&mut found).map_err(told)?;
            if !found.is_empty() {
                if found.trim_end_matches(['\r', '\n']) != head {
                    return Err(format!(
                        "{}: the table that is there has other columns: found `{}`, expected \
                         `{head}`",
                        path.display(),
                        found.trim_end()
                    ));
                }
                // A row that a run did not come to finish is closed.
                let end = file.seek(SeekFrom::End(-1)).map_err(told)?;
                let mut last = [0];
                std::io::Read::read_exact(&mut file, &mut last).map_err(told)?;
                if end > 0 && last != [b'\n'] {
                    file.write_all(b"\n").map_err(told)?;
                }
                return Ok(Self { file, is_failing: false });
            }
        }
        let mut file = File::create(path).map_err(told)?;
        file.write_all(format!("{head}\n").as_bytes()).map_err(told)?;
        Ok(Self { file, is_failing: false })
    }

    /// Adds a row, which is in the file when this returns, or nothing of it. The table goes on with the
    /// next that can be written.
    ///
    /// # Errors
    /// Why it cannot be written, told of the first of several in a row.
    pub(crate) fn push(&mut self, cycle: u64, time: f64, values: &[f64]) -> Result<(), String> {
        let mut row = format!("{cycle},{time}");
        for value in values {
            let _ = match value.is_nan() {
                true => write!(row, ",nan"),
                false => write!(row, ",{value}"),
            };
        }
        row.push('\n');
        let was_failing = std::mem::replace(&mut self.is_failing, false);
        self.write(row.as_bytes()).or_else(|error| {
            self.is_failing = true;
            if was_failing { Ok(()) } else { Err(error.to_string()) }
        })
    }

    fn write(&mut self, row: &[u8]) -> std::io::Result<()> {
        let end = self.file.seek(SeekFrom::End(0))?;
        // In one piece, so that who reads meanwhile sees whole rows.
        self.file.write_all(row).and_then(|()| self.file.flush()).inspect_err(|_| {
            let _ = self.file.set_len(end);
        })
    }
}

/// The first line of a table whose columns behind `cycle` and `time` have these titles.
pub(crate) fn head(titles: &[String]) -> String {
    let quoted = |title: &String| match title.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", title.replace('"', "\"\"")),
        false => title.clone(),
    };
    let titles = titles.iter().map(quoted);
    ["cycle".to_owned(), "time".to_owned()].into_iter().chain(titles).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use std::fs::{read_to_string, write};

    use super::*;

    fn table(existing: Existing) -> Table {
        let titles = vec!["drop [Pa]".into(), "a, b".into()];
        Table { file: "a.csv".into(), titles, existing }
    }

    /// `/dev/full` is the disk that has no room.
    #[cfg(target_os = "linux")]
    #[test]
    fn a_table_goes_on_once_there_is_room() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.csv");
        let mut open = OpenTable::open(&path, &table(Existing::Replace)).unwrap();
        let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let file = std::mem::replace(&mut open.file, full);
        assert!(open.push(1, 0.1, &[1.0, 2.0]).unwrap_err().contains("space"));
        assert_eq!(open.push(2, 0.2, &[1.0, 2.0]), Ok(()), "told once");
        open.file = file;
        open.push(3, 0.3, &[1.0, 2.0]).unwrap();
        let rows = read_to_string(&path).unwrap();
        assert!(rows.ends_with("\"a, b\"\n3,0.3,1,2\n"), "{rows}");
    }

    #[test]
    fn rows_are_added_and_what_was_there_is_replaced_or_continued() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("new/a.csv");
        let push = |existing, cycle: u64| {
            let mut open = OpenTable::open(&path, &table(existing))?;
            open.push(cycle, 0.1, &[1.5, f64::NAN])
        };
        push(Existing::Continue, 1).unwrap();
        push(Existing::Continue, 2).unwrap();
        let head = "cycle,time,drop [Pa],\"a, b\"\n";
        assert_eq!(read_to_string(&path).unwrap(), format!("{head}1,0.1,1.5,nan\n2,0.1,1.5,nan\n"));
        push(Existing::Replace, 3).unwrap();
        assert_eq!(read_to_string(&path).unwrap(), format!("{head}3,0.1,1.5,nan\n"));
        // A run that was killed in the middle of a row.
        write(&path, format!("{head}3,0.1,1.")).unwrap();
        push(Existing::Continue, 4).unwrap();
        assert_eq!(read_to_string(&path).unwrap(), format!("{head}3,0.1,1.\n4,0.1,1.5,nan\n"));
        write(&path, "cycle,time,lift\n1,2,3\n").unwrap();
        let error = push(Existing::Continue, 5).unwrap_err();
        assert!(error.contains("found `cycle,time,lift`"), "{error}");
        assert_eq!(read_to_string(&path).unwrap(), "cycle,time,lift\n1,2,3\n", "left as it was");
    }
}
