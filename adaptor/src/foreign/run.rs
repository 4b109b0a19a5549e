//! One run: the adaptor, what is kept for it of each channel, and what it asks of the solver.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use tombolo_deform::communicator::{Alarm, Communicator, Reduction};
use tombolo_deform::mesh::MeshView;
use tombolo_pipelines::extract::{self, FieldView};

use crate::foreign::asked::Asked;
use crate::foreign::error::RunError;
use crate::foreign::mesh::{Block, Channel, Grid, Kept};
use crate::foreign::ranks;
use crate::{Adaptor, FinalizeError, OrderReport, Report, Settings, Step, Stopper};

/// Why orders are rejected from then on.
const OTHER_MESH: &str = "the solver has made another mesh: shapes are measured from the mesh of the first step, so its cells must stay the same";

/// Why orders are rejected once their channel is no longer shown.
const NO_MESH: &str = "the solver no longer shows the mesh that orders change";

/// A step as the solver shows it.
pub struct Shown<'call> {
    /// Its cycle, time and length.
    pub step: Step,
    /// The answer of [`Run::looks_at`] for it, by which the channels were read: without fields and
    /// features where it is no. Commands arrive at any time, so that a second answer may be another.
    pub looked_at: bool,
    /// The channels.
    pub channels: Vec<Channel<'call>>,
}

/// A run under way: the adaptor, and what it asks of a solver that reads it later.
pub struct Run {
    adaptor: Adaptor,
    communicator: Arc<dyn Communicator>,
    kept: HashMap<String, Kept>,
    /// The channels of which all ranks know how many coordinates a vertex has.
    measured: HashSet<String>,
    /// The channel that orders change.
    steered: String,
    /// Its meshes and how many vertices each has.
    blocks: Vec<(String, usize)>,
    last_time: Option<f64>,
    time_step: f64,
    asked: Asked,
    /// The hash of the chosen pipelines' names; 0 where all run.
    choice: u64,
    /// Whether the last call was refused: what is kept may be half of what it showed.
    was_refused: bool,
    /// The notes on what is passed over that were logged: each is logged once.
    told: HashSet<String>,
}

impl Run {
    /// Begins. Collective.
    ///
    /// # Errors
    /// [`RunError::Initialize`].
    pub fn new(settings: Settings) -> Result<Self, RunError> {
        crate::logging::start();
        let asked = Asked::of(&settings.parameters);
        let communicator = Arc::clone(&settings.communicator);
        let adaptor = Adaptor::initialize(settings)?;
        let last_time = adaptor.last_moment().map(|moment| moment.time);
        Ok(Self {
            adaptor,
            communicator,
            kept: HashMap::new(),
            measured: HashSet::new(),
            steered: String::new(),
            blocks: Vec::new(),
            last_time,
            time_step: 0.0,
            asked,
            choice: 0,
            was_refused: false,
            told: HashSet::new(),
        })
    }

    /// To be held while all ranks are in a call.
    pub fn alarm(&self) -> Alarm {
        Alarm::among(&self.communicator)
    }

    /// Lets only these of the solver's pipelines run from now on, and all others; `None`: all.
    pub fn choose(&mut self, names: Option<&[&str]>, of_solver: &dyn Fn(&str) -> bool) {
        let choice = names.map_or(0, |names| ranks::choice_of(&names.join("\n")));
        if choice != self.choice {
            self.choice = choice;
            self.adaptor.choose_pipelines(|name| {
                !of_solver(name) || names.is_none_or(|names| names.contains(&name))
            });
        }
    }

    /// Whether anything is due that looks at the mesh and its fields, or the last call was refused,
    /// so that all of the next one is read anew.
    #[must_use]
    pub fn looks_at(&self, step: &Step) -> bool {
        self.adaptor.looks_at(step) || self.was_refused
    }

    /// Whether a channel has to be read with its fields and features though [`Run::looks_at`] says
    /// no: its mesh is not known yet, has another size, or lies otherwise in memory than before.
    #[must_use]
    pub fn needs_whole(&self, channel: &Channel<'_>) -> bool {
        self.kept.get(&channel.name).is_none_or(|kept| !kept.suffices(channel))
    }

    /// Saves the state of the run in a file, if one is named: see [`Adaptor::write_checkpoint`].
    /// Collective.
    ///
    /// `file` is what the solver names, or why it cannot be read; errors call it `what`. It is agreed
    /// upon first: a rank whose own is wrong would leave the others waiting.
    ///
    /// # Errors
    /// The mistake in what is named, on any rank, or [`RunError::Wrong`] where ranks name others; then
    /// nothing is saved on any rank. [`RunError::Checkpoint`].
    pub fn checkpoint(
        &mut self,
        file: Result<Option<String>, RunError>,
        what: &str,
    ) -> Result<(), RunError> {
        let _alarm = self.alarm();
        match ranks::agree_on(&*self.communicator, file, what)? {
            Some(file) => Ok(self.adaptor.write_checkpoint(file)?),
            None => Ok(()),
        }
    }

    /// The link that a viewer opens, with the secret of those who may drive.
    #[must_use]
    pub fn link(&self) -> Option<String> {
        self.adaptor.link()
    }

    /// The link of those who watch and can never drive.
    #[must_use]
    pub fn watching_link(&self) -> Option<String> {
        self.adaptor.watching_link()
    }

    /// Ends the steering of the shape: see [`Adaptor::release_shape`]. Collective.
    ///
    /// `reason` is what the solver says, or why that cannot be read.
    ///
    /// # Errors
    /// The mistake in what is said, on any rank; then the shape is steered as before on all.
    pub fn release_shape(&mut self, reason: Result<String, RunError>) -> Result<(), RunError> {
        let _alarm = self.alarm();
        let reason = ranks::agree(&*self.communicator, reason)?;
        self.adaptor.release_shape(&reason);
        Ok(())
    }

    /// Asks the solver to end, from any thread.
    #[must_use]
    pub fn stopper(&self) -> Stopper {
        self.adaptor.stopper()
    }

    /// The text that invites a person to open the run: see [`Adaptor::invitation`].
    ///
    /// # Errors
    /// Where the file of the links cannot be written.
    pub fn invitation(&mut self, terminal: bool) -> std::io::Result<Option<String>> {
        self.adaptor.invitation(terminal)
    }

    /// Has something called while the solver waits: see [`Adaptor::while_waiting`].
    pub fn while_waiting(&mut self, look: impl FnMut() + Send + 'static) {
        self.adaptor.while_waiting(look);
    }

    /// The steering of the step that follows.
    #[must_use]
    pub fn asked(&self) -> &Asked {
        &self.asked
    }

    /// The channel that orders change, its meshes and how many vertices each has.
    #[must_use]
    pub fn steered(&self) -> (&str, &[(String, usize)]) {
        (&self.steered, &self.blocks)
    }

    /// The orders so far and what became of each.
    #[must_use]
    pub fn orders(&self) -> Vec<OrderReport> {
        self.adaptor.orders()
    }

    /// The length of the step to come, where the solver does not say: that of the step that has
    /// been.
    #[must_use]
    pub fn likely_time_step(&self, time: f64) -> f64 {
        match self.last_time {
            Some(last) if time > last => time - last,
            Some(last) if time < last => 0.0,
            _ => self.time_step,
        }
    }

    /// Shows a step to the adaptor. Collective.
    ///
    /// `given` is what the solver shows, or why it cannot be shown; then nothing was done, on any
    /// rank. Says whether any rank showed a channel; where none did, nothing was done either.
    ///
    /// # Errors
    /// The mistake in what is given, on any rank: then all ranks have an error, and are asked for no
    /// motion. [`RunError::Choices`], and what the adaptor refuses.
    pub fn execute<'call>(
        &mut self,
        given: Result<Shown<'call>, RunError>,
    ) -> Result<bool, RunError> {
        // What an earlier step asked for is not asked again, whatever becomes of this one.
        self.asked.rest();
        let shown = self.show(given);
        self.was_refused = shown.is_err();
        shown
    }

    fn show<'call>(&mut self, given: Result<Shown<'call>, RunError>) -> Result<bool, RunError> {
        // What can be wrong here alone is agreed upon before anything that all do together.
        let mut is_other = false;
        let prepared = self.cover(given).and_then(|Shown { step, looked_at, channels }| {
            let mut may_tell = looked_at;
            for channel in &channels {
                let changed = self.update(channel, looked_at)?;
                may_tell |= changed;
                is_other |= changed && channel.name == self.steered;
            }
            Ok((step, channels, may_tell))
        });
        let ((step, mut channels, may_tell), is_other) =
            ranks::agree_and_ask(&*self.communicator, prepared, is_other, self.choice)?;
        self.time_step = step.time_step;
        self.last_time = Some(step.time);
        self.complete(&mut channels)?;
        self.keep_in_planes(&channels);
        let replaced = if self.loses_steered(&mut channels) {
            Some(NO_MESH)
        } else {
            is_other.then_some(OTHER_MESH)
        };
        // What is passed over can be new only where something was read.
        if may_tell {
            self.tell(&channels);
        }
        // A solver that shows nothing yet is asked for nothing.
        if channels.is_empty() {
            return Ok(false);
        }
        let Self { adaptor, kept, asked, .. } = self;
        let mut fields: Vec<Vec<FieldView<'_>>> = channels.iter().map(|_| Vec::new()).collect();
        let mut meshes: Vec<MeshView<'_>> = Vec::with_capacity(channels.len());
        for (channel, fields) in channels.iter().zip(&mut fields) {
            if let Some(kept) = kept.get(&channel.name) {
                meshes.push(kept.views(channel, fields));
            }
        }
        let parts = channels.iter().zip(meshes).zip(&fields);
        let views: Vec<extract::Channel<'_>> = parts
            .map(|((channel, mesh), fields)| extract::Channel { name: &channel.name, mesh, fields })
            .collect();
        // The shape is let go of only with a mesh that passes: one that is refused changes nothing.
        let steering = match replaced {
            Some(reason) => adaptor.execute_replaced(&step, &views, reason),
            None => adaptor.execute(&step, &views),
        };
        asked.take(&steering?);
        for channel in &channels {
            self.kept.get_mut(&channel.name).into_iter().for_each(Kept::pass);
        }
        self.note_steered(&channels);
        Ok(true)
    }

    /// Notes the channel that orders change, and its meshes.
    fn note_steered(&mut self, channels: &[Channel<'_>]) {
        let named = self.adaptor.steered_channel();
        let steered = channels.iter().find(|channel| named.is_none_or(|name| channel.name == name));
        self.steered.clear();
        self.blocks.clear();
        if let Some(channel) = steered {
            self.steered.push_str(&channel.name);
            let count = |block: &Block<'_>| (block.name.clone(), block.vertex_count());
            self.blocks.extend(channel.blocks.iter().map(count));
        }
    }

    fn update(&mut self, channel: &Channel<'_>, looked_at: bool) -> Result<bool, RunError> {
        self.kept.entry(channel.name.clone()).or_default().update(channel, looked_at)
    }

    /// Leaves out the cells that finer grids of other ranks cover. Collective.
    fn cover<'call>(
        &self,
        given: Result<Shown<'call>, RunError>,
    ) -> Result<Shown<'call>, RunError> {
        if self.communicator.size() == 1 {
            return given;
        }
        let has_grids = |channels: &[Channel<'_>]| {
            channels.iter().any(|channel| channel.grids().next().is_some())
        };
        let (mut given, any) = ranks::ask(&*self.communicator, given, |shown| {
            shown.looked_at && has_grids(&shown.channels)
        });
        if any {
            let own: Vec<(&str, Vec<Grid>)> = given
                .iter()
                .flat_map(|shown| &shown.channels)
                .map(|channel| (channel.name.as_str(), channel.grids().collect()))
                .collect();
            let all: Vec<(String, Vec<Grid>)> = ranks::gathered(&*self.communicator, &own);
            for channel in given.iter_mut().flat_map(|shown| &mut shown.channels) {
                let of_channel = all.iter().filter(|(name, _)| *name == channel.name);
                let grids: Vec<Grid> =
                    of_channel.flat_map(|(_, grids)| grids.iter().copied()).collect();
                channel.cover(&grids);
            }
        }
        given
    }

    /// Says once what is passed over.
    fn tell(&mut self, channels: &[Channel<'_>]) {
        if self.communicator.rank() > 0 {
            return;
        }
        for channel in channels {
            for note in channel.notes.iter().chain(&channel.passed_over()) {
                if !self.told.contains(note) {
                    tracing::warn!(run = self.adaptor.run_id(), "{note}");
                    self.told.insert(note.clone());
                }
            }
        }
    }

    /// Gives every rank the channels of all, empty where it has none, in one order. Collective.
    fn complete(&mut self, channels: &mut Vec<Channel<'_>>) -> Result<(), RunError> {
        if self.communicator.size() == 1 {
            return Ok(());
        }
        let own: Vec<&str> = channels.iter().map(|channel| channel.name.as_str()).collect();
        let names = ranks::union(&*self.communicator, &own);
        let mut given = std::mem::take(channels);
        for name in names {
            channels.push(match given.iter().position(|channel| channel.name == name) {
                Some(place) => given.swap_remove(place),
                None => {
                    let nothing = Channel { name, ..Channel::default() };
                    self.update(&nothing, true)?;
                    nothing
                }
            });
        }
        Ok(())
    }

    /// Keeps the channel that orders change, where nothing names it, as the first, which it was in the
    /// first step: another one must not be taken for it. Says whether the solver no longer shows it
    /// while it shows others.
    fn loses_steered(&self, channels: &mut [Channel<'_>]) -> bool {
        if self.steered.is_empty() || self.adaptor.steered_channel().is_some() {
            return false;
        }
        match channels.iter().position(|channel| channel.name == self.steered) {
            Some(index) => {
                channels[..=index].rotate_right(1);
                false
            }
            None => !channels.is_empty(),
        }
    }

    /// Rejects orders that leave the plane of a channel whose vertices have two coordinates: the solver
    /// could not take the third of them ([`Adaptor::keep_in_plane`]). Collective, and for each channel
    /// only until a rank has a vertex of it.
    fn keep_in_planes(&mut self, channels: &[Channel<'_>]) {
        for channel in channels {
            if self.measured.contains(&channel.name) {
                continue;
            }
            // Orders are refused by rank 0, which may have no vertex of this channel.
            let mut most = [channel.dimension() as u64];
            self.communicator.reduce_integers(Reduction::Maximum, &mut most);
            if most[0] == 0 {
                continue;
            }
            if most[0] < 3 {
                self.adaptor.keep_in_plane(&channel.name);
            }
            self.measured.insert(channel.name.clone());
        }
    }

    /// Says that the solver has failed on this rank, which shows no step any more: the others have
    /// it as an error of their next call, and do not wait for it. Then [`Run::finalize`] follows.
    /// Nothing where there is one rank.
    pub fn leave(&mut self, reason: &str) {
        if self.communicator.size() > 1 {
            let _alarm = self.alarm();
            let _ = self.execute(Err(RunError::Left(reason.to_owned())));
        }
    }

    /// Waits until all ranks are at the end. One that [leaves](Run::leave) says so first, and one
    /// that shows a step is told; both come here next. Collective, by the same messages as a step.
    fn meet_at_end(&self) {
        while self.communicator.size() > 1 {
            let step = Step { cycle: 0, time: 0.0, time_step: 0.0 };
            let nothing = self.cover(Ok(Shown { step, looked_at: false, channels: Vec::new() }));
            let met = ranks::agree_and_ask(&*self.communicator, nothing, false, ranks::ENDING);
            if met.is_ok() {
                break;
            }
        }
    }

    /// Ends the run. Collective. The report is there even where a file could not be written.
    pub fn finalize(self) -> (Report, Result<(), RunError>) {
        self.meet_at_end();
        match self.adaptor.finalize() {
            Ok(report) => (report, Ok(())),
            Err(error) => {
                let FinalizeError::Files { report, .. } = &error;
                ((**report).clone(), Err(error.into()))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use tombolo_deform::communicator::threads;
    use tombolo_deform::mesh::CellType;
    use tombolo_pipelines::language;

    use super::*;
    use crate::foreign::array::{Array, NumberType};
    use crate::foreign::mesh::{Coordset, Domain, Label, Mask, Roles, Topology};

    /// A channel of quads; each array is one of the coordinates.
    fn plate<'call>(axes: &[&'call [f64]], quads: &'call [i32]) -> Channel<'call> {
        let axis = |values: &&'call [f64]| {
            // SAFETY: a slice that is borrowed for as long as the array.
            unsafe { Array::new(values.as_ptr().cast(), values.len(), 8, NumberType::F64, false) }
        };
        // SAFETY: as above.
        let connectivity =
            unsafe { Array::new(quads.as_ptr().cast(), quads.len(), 4, NumberType::I32, false) };
        let label = Label::Words("channel 'plate'".into());
        let domain = Domain {
            coordset: Coordset::Explicit { axes: axes.iter().map(axis).collect() },
            topology: Topology::Uniform {
                cell_type: CellType::Quad,
                connectivity,
                label: label.clone(),
            },
            fields: Vec::new(),
            faces: Vec::new(),
            roles: Roles::default(),
            label: label.clone(),
        };
        Channel {
            name: "plate".into(),
            label,
            blocks: vec![Block { name: String::new(), domain, mask: Mask::default() }],
            ..Channel::default()
        }
    }

    #[test]
    fn a_text_that_one_rank_gets_wrong_is_an_error_on_all() {
        let output = tempfile::tempdir().expect("a temporary directory");
        let file = output.path().join("run.state");
        let told = threads::run(2, |ranks| {
            let rank = ranks.rank();
            let settings = Settings {
                communicator: Arc::new(ranks),
                output: output.path().into(),
                ..Settings::default()
            };
            let mut run = Run::new(settings).expect("begins");
            let given = |text: &str| {
                if rank == 0 {
                    Err(RunError::Configuration("no text".into()))
                } else {
                    Ok(text.into())
                }
            };
            let saved = run.checkpoint(given(&file.to_string_lossy()).map(Some), "file");
            let other = run.checkpoint(Ok((rank == 0).then(|| "other".to_owned())), "file");
            let released = run.release_shape(given("another mesh"));
            drop(run.finalize());
            [saved, other, released].map(|done| done.map_err(|error| error.to_string()))
        });
        let refused = |words: &str| Err(words.to_owned());
        let other = "'file': found another one on other ranks, or none; expected the same on all";
        assert_eq!(told[0], [refused("no text"), refused(other), refused("no text")]);
        assert_eq!(
            told[1],
            [refused("rank 0: no text"), refused(other), refused("rank 0: no text")]
        );
        assert!(!file.exists());
    }

    #[test]
    fn a_plane_is_kept_where_rank_0_has_no_vertex() {
        const SIDE: i32 = 5;
        let x: Vec<f64> = (0..SIDE * SIDE).map(|vertex| f64::from(vertex % SIDE) / 4.0).collect();
        let y: Vec<f64> = (0..SIDE * SIDE).map(|vertex| f64::from(vertex / SIDE) / 4.0).collect();
        let low = (0..SIDE * (SIDE - 1)).filter(|vertex| vertex % SIDE < SIDE - 1);
        let quads: Vec<i32> =
            low.flat_map(|low| [low, low + 1, low + SIDE + 1, low + SIDE]).collect();
        let order = r#"[{"at": {"cycle": 1}, "order": {"edits": [{"translate": {
            "region": {"box": {"lower": [-1, -1, -1], "upper": [0.5, 2, 1]}}, "by": [0.1, 0, 0.3]}}]}}]"#;
        let output = tempfile::tempdir().expect("a temporary directory");
        let told = threads::run(2, |ranks| {
            let rank = ranks.rank();
            let mut run = Run::new(Settings {
                communicator: Arc::new(ranks),
                orders: language::check_orders(order, "orders").expect("orders"),
                output: output.path().into(),
                ..Settings::default()
            })
            .expect("begins");
            for cycle in 0..4_u32 {
                // Rank 0 has neither points nor cells, and says so in three coordinates.
                let channel = if rank == 0 {
                    plate(&[&[], &[], &[]], &[])
                } else {
                    plate(&[&x[..], &y[..]], &quads)
                };
                let step =
                    Step { cycle: cycle.into(), time: 0.1 * f64::from(cycle), time_step: 0.1 };
                let looked_at = run.looks_at(&step);
                let given = Shown { step, looked_at, channels: vec![channel] };
                assert!(run.execute(Ok(given)).expect("passes"));
            }
            let orders = serde_json::to_string(&run.orders()).expect("JSON");
            drop(run.finalize());
            orders
        });
        assert!(
            told[0].contains("\"rejected\"") && told[0].contains("along z, expected 0"),
            "{told:?}"
        );
    }
}
