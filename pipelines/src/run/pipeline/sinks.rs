//! Where extracts and monitors go, and the commands that a pipeline gives.

use std::fmt::Write as _;
use std::sync::Arc;

use tombolo_deform::number::Number;

use super::super::output::{Frame, Output};
use super::prepare::Names;
use super::{Prepared, Progress, Seen};
use crate::extract::{Field, Snapshot, is_absent, skin};
use crate::language::{
    Change, Command, Log, Order, OrderStage, StreamStage, Write, file_pattern, series_of,
};

impl Prepared {
    pub(super) fn stream(&self, stage: &StreamStage, progress: &mut Progress) {
        let Some(mut extract) = self.finished(progress) else { return };
        match skin(&extract) {
            Ok(Some(outside)) => extract = outside.into(),
            Ok(None) => {}
            Err(error) => progress.errors.push(("skin".into(), error.to_string())),
        }
        let lacks = |field: &Field| field.values.iter().any(|&value| is_absent(value));
        if extract.fields.iter().any(lacks) {
            for field in Arc::make_mut(&mut extract).fields.extract_if(.., |field| lacks(field)) {
                let message = format!(
                    "field `{}` is not on all of the mesh; it is not sent to viewers",
                    field.name
                );
                progress.errors.push((format!("absent {}", field.name), message));
            }
        }
        progress.cost.bytes += extract.bytes() as u64;
        progress.outputs.push(Output::Frame(Frame {
            pipeline: Arc::clone(&self.name),
            cycle: progress.snapshot.cycle,
            time: progress.snapshot.time,
            extract,
            encoding: (*stage).into(),
        }));
    }

    pub(super) fn write(&self, stage: &Write, progress: &mut Progress) {
        let Some(extract) = self.finished(progress) else { return };
        let Snapshot { cycle, time, .. } = *progress.snapshot;
        match file_pattern(&stage.file, cycle, time) {
            Ok(path) => {
                let pipeline = Arc::clone(&self.name);
                let (series, keep) = series_of(&self.pipeline, &stage.file);
                progress.cost.bytes += extract.bytes() as u64;
                progress.outputs.push(Output::Write {
                    pipeline,
                    path,
                    cycle,
                    time,
                    extract,
                    series,
                    keep,
                });
            }
            Err(problem) => progress.errors.push(("write".into(), problem.to_string())),
        }
    }

    pub(super) fn order(&self, stage: &OrderStage, progress: &mut Progress) {
        let edits = std::mem::take(&mut progress.edits);
        let OrderStage { schedule, deform, guard } = stage.clone();
        let order = Order { schedule, deform, guard, ..Order::from(Change::Edits(edits)) };
        self.command(Command::Order(order), progress);
    }

    pub(super) fn command(&self, command: Command, progress: &mut Progress) {
        progress.outputs.push(Output::Command { pipeline: Arc::clone(&self.name), command });
    }
    /// A row of a table; on rank 0.
    pub(super) fn row(&self, names: &Names, seen: &Seen) -> Option<Output> {
        let Names::Table(table, slots) = names else { return None };
        seen.is_first.then(|| Output::Row {
            pipeline: Arc::clone(&self.name),
            table: Arc::clone(table),
            cycle: seen.cycle,
            time: seen.time,
            values: slots.iter().map(|slot| seen.value(slot)).collect(),
        })
    }

    /// A line of the log; on rank 0.
    pub(super) fn log(&self, stage: &Log, names: &Names, seen: &Seen) -> Option<Output> {
        let Names::Line(parts) = names else { return None };
        let mut message = String::new();
        for (text, slot) in parts {
            message.push_str(text);
            if let Some(slot) = slot {
                let _ = write!(message, "{}", Number(seen.value(slot)));
            }
        }
        let (pipeline, level) = (Arc::clone(&self.name), stage.level);
        seen.is_first.then_some(Output::Log { pipeline, level, message })
    }
}
