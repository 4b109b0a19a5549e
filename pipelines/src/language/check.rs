//! Every error of a text at once.

use std::collections::HashSet;

use serde::de::DeserializeOwned;
use serde_json::Number;
use tombolo_deform::edit::Edit;

use super::journal::{JournalNote, is_like_entry, is_note};
use super::kind::Kind;
use super::mend::{Mender, Piece, Taken, rescue, take, take_list};
use super::order::{Change, Command, Order};
use super::orders_text::OrdersText;
use super::parse::{Document, Validate};
use super::relative_files::{resolve_files, resolve_pipeline_files};
use super::scan::{Member, Node, Value};
use super::timed::{JournalEntry, OrderStatus, TimedCommand, lines, torn_line};
use super::unread::Unread;
use super::{
    Action, Config, Deformation, LanguageErrors, Pipeline, Problem, Stage, monitors_of,
    parse_orders,
};
use crate::limits::WAITING_BYTES;

/// Something that what was read is tried on, such as a mesh.
pub trait Trial {
    /// The problems of a configuration's pipelines. Only of those at whose index `is_sound`
    /// holds do all stages and actions mean something; the others must not be run. Their conditions
    /// may be wrong all the same.
    fn configuration(&mut self, config: &Config, is_sound: &dyn Fn(usize) -> bool) -> Vec<Problem>;

    /// The problems of edits that are valid by themselves.
    fn edits(&mut self, edits: &[Edit]) -> Vec<Problem>;

    /// The problems of a deformation's settings.
    fn deformation(&mut self, deformation: &Deformation) -> Vec<Problem>;
}

/// Reads and checks a configuration as [`parse`](super::parse) does, and tells every error.
///
/// Each stage, action and setting is read by itself. One that is wrong does not hide what is wrong
/// elsewhere: a misspelt name is taken for the one that is nearest, and what would follow from an
/// error alone is not told. A stage may have errors that show only when others are mended. Where the
/// text is not JSON, that is the only error.
///
/// # Errors
/// [`LanguageErrors`] for the very texts that [`parse`](super::parse) refuses.
pub fn check(text: &str, file: &str) -> Result<Config, LanguageErrors> {
    check_configuration(&Document::read(text, file)?, &mut None)
}

/// Reads and checks a file of orders as [`parse_orders`] does, and tells every error: each command,
/// edit and line is read by itself.
///
/// # Errors
/// [`LanguageErrors`] for the very texts that [`parse_orders`] refuses.
pub fn check_orders(text: &str, file: &str) -> Result<Vec<TimedCommand>, LanguageErrors> {
    check_commands(text, file, &mut None)
}

/// A trial, where there is one.
type Tried<'t> = Option<&'t mut dyn Trial>;

fn check_configuration(
    document: &Document<'_>,
    trial: &mut Tried<'_>,
) -> Result<Config, LanguageErrors> {
    let read: Result<Config, _> = document.valid();
    let config = read.map(|mut config| {
        resolve_pipeline_files(&mut config.pipelines, document.file);
        config
    });
    if let (Ok(_), None) = (&config, &trial) {
        return Ok(config?);
    }
    let mut mender = Mender::new(document);
    configuration(&mut mender, &mut document.root.clone(), trial);
    match mender.into_errors() {
        Some(errors) => Err(errors),
        None => Ok(config?),
    }
}

fn check_commands(
    text: &str,
    file: &str,
    trial: &mut Tried<'_>,
) -> Result<Vec<TimedCommand>, LanguageErrors> {
    let commands = parse_orders(text, file);
    if let (Ok(_), None) = (&commands, &trial) {
        return Ok(commands?);
    }
    if text.len() > WAITING_BYTES.most {
        return Ok(commands?);
    }
    let errors = match OrdersText::read(text, file) {
        Ok(OrdersText::List(document)) => errors_in(&document, |mender, tree| {
            let mut commands = Vec::new();
            for piece in mender.items(tree, timed) {
                commands.extend(piece.value);
            }
            let tried = |(index, timed): (usize, &TimedCommand)| {
                let problems = problems_of_command(&timed.command, file, trial);
                problems.into_iter().map(move |problem| problem.at(index)).collect::<Vec<_>>()
            };
            let tried = commands.iter().enumerate().flat_map(tried).collect::<Vec<_>>();
            [commands.problems(), tried].concat()
        }),
        Ok(OrdersText::One(document)) => errors_in(&document, |mender, tree| {
            problems_of(timed(mender, tree), |timed| &timed.command, file, trial)
        }),
        Ok(OrdersText::Lines) => errors_in_lines(text, file, trial),
        Ok(OrdersText::Nothing) | Err(_) => None,
    };
    match errors {
        Some(errors) => Err(errors),
        None => Ok(commands?),
    }
}

/// The problems of something that holds a command, and those that a trial of the command shows.
fn problems_of<T: Validate>(
    piece: Piece<T>,
    command: impl FnOnce(&T) -> &Command,
    file: &str,
    trial: &mut Tried<'_>,
) -> Vec<Problem> {
    let Some(value) = piece.value else { return Vec::new() };
    [value.problems(), problems_of_command(command(&value), file, trial)].concat()
}

/// The problems that a trial of a command shows.
fn problems_of_command(command: &Command, file: &str, trial: &mut Tried<'_>) -> Vec<Problem> {
    let Command::Order(order) = command else { return Vec::new() };
    let problems = problems_of_order(order, file, trial);
    problems.into_iter().map(|problem| problem.within("order")).collect()
}

fn problems_of_order(order: &Order, file: &str, trial: &mut Tried<'_>) -> Vec<Problem> {
    let Some(trial) = trial.as_mut().filter(|_| order.validate().is_ok()) else {
        return Vec::new();
    };
    let key = match order.change {
        Change::Stack(_) => "stack",
        _ => "edits",
    };
    let mut edits = order.edits().to_vec();
    resolve_files(&mut edits, file);
    let of_edits = trial.edits(&edits).into_iter().map(|problem| problem.within(key));
    let mut problems: Vec<Problem> = of_edits.collect();
    if let Some(deform) = &order.deform {
        let of_deform = trial.deformation(deform);
        problems.extend(of_deform.into_iter().map(|problem| problem.within("deform")));
    }
    problems
}

/// The content of a JSON file.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// A configuration.
    Configuration(Box<Config>),
    /// Commands for a run: a list, one alone, or a journal.
    Orders(Vec<TimedCommand>),
    /// One order of a new shape, which says nothing of when.
    Order(Box<Order>),
    /// A list of edits.
    Edits(Vec<Edit>),
}

/// Reads and checks a text as what it looks like: a configuration, commands for a run, an order or
/// a list of edits. Its keys decide; where they do not, it is taken for a configuration.
///
/// ```
/// use tombolo_pipelines::language::{Content, check_content};
///
/// let content = check_content(r#"{"undo": 1}"#, "back.json", None)?;
/// assert!(matches!(content, Content::Order(_)));
/// let content = check_content(r#"[{"at": {"cycle": 3}, "stop": {}}]"#, "orders.json", None)?;
/// assert!(matches!(content, Content::Orders(commands) if commands.len() == 1));
/// # Ok::<(), tombolo_pipelines::language::LanguageErrors>(())
/// ```
///
/// Whatever is valid by itself is then tried, where there is a `trial`:
/// [`MeshTrial`](crate::run::MeshTrial) is one on a mesh.
///
/// # Errors
/// All errors of a text of that kind, and those that the trial shows.
pub fn check_content(
    text: &str,
    file: &str,
    mut trial: Option<&mut dyn Trial>,
) -> Result<Content, LanguageErrors> {
    let trial = &mut trial;
    let document = match OrdersText::read(text, file) {
        Ok(OrdersText::List(document) | OrdersText::One(document)) => document,
        Ok(OrdersText::Lines) => return check_commands(text, file, trial).map(Content::Orders),
        // An empty text is no configuration, which it would have to be.
        Ok(OrdersText::Nothing) => Document::read(text, file)?,
        Err(error) => return Err(error.into()),
    };
    let is_list = matches!(document.root.value, Value::Array(_));
    match Kind::of(&document.root) {
        Kind::Configuration => check_configuration(&document, trial)
            .map(|config| Content::Configuration(config.into())),
        Kind::Orders => check_commands(text, file, trial).map(Content::Orders),
        Kind::Edits if is_list => {
            let read = document.valid::<Vec<Edit>>();
            let errors = errors_in(&document, |mender, tree| {
                let read = mender.items(tree, |mender, node| mender.read(node));
                let mut edits: Vec<Edit> = read.into_iter().filter_map(|edit| edit.value).collect();
                resolve_files(&mut edits, file);
                let problems = edits.problems();
                match trial {
                    Some(trial) if problems.is_empty() => trial.edits(&edits),
                    _ => problems,
                }
            });
            errors.map_or(Ok(()), Err)?;
            let mut edits = read?;
            resolve_files(&mut edits, file);
            Ok(Content::Edits(edits))
        }
        Kind::Edits => {
            let read = document.valid::<Order>();
            let errors = errors_in(&document, |mender, tree| {
                let Some(order) = order(mender, tree).value else { return Vec::new() };
                [order.problems(), problems_of_order(&order, file, trial)].concat()
            });
            errors.map_or(Ok(()), Err)?;
            let mut order = read?;
            resolve_files(order.edits_mut(), file);
            Ok(Content::Order(order.into()))
        }
    }
}

/// The errors of a document that is read in pieces, which have problems.
fn errors_in(
    document: &Document<'_>,
    read: impl FnOnce(&mut Mender<'_>, &mut Node) -> Vec<Problem>,
) -> Option<LanguageErrors> {
    let mut mender = Mender::new(document);
    let mut tree = document.root.clone();
    for problem in read(&mut mender, &mut tree) {
        mender.note_problem(problem, &tree);
    }
    mender.into_errors()
}

/// The errors of all lines; that a line is not JSON says nothing of the others.
fn errors_in_lines(text: &str, file: &str, trial: &mut Tried<'_>) -> Option<LanguageErrors> {
    let mut all: Option<LanguageErrors> = None;
    let rejected = match trial {
        Some(_) => rejected(text, file),
        None => HashSet::new(),
    };
    let torn = torn_line(text);
    for (number, content) in lines(text) {
        let errors = match Document::read(content, file) {
            Err(_) if torn == Some(number) => None,
            Err(error) => Some(error.into()),
            Ok(line) if is_note(&line) => errors_in(&line, |mender, tree| {
                mender.read::<JournalNote>(tree);
                Vec::new()
            }),
            Ok(line) if is_like_entry(&line) => errors_in(&line, |mender, tree| {
                let set = |entry: &mut JournalEntry, order| entry.command = Some(order);
                let Some(entry) = command(mender, tree, set).value else { return Vec::new() };
                let mut problems = entry.problems();
                // What the mesh of that run did not allow was told then.
                if let Some(command) = entry.command.filter(|_| !rejected.contains(&entry.id)) {
                    problems.extend(problems_of_command(&command, file, trial));
                }
                problems
            }),
            Ok(line) => errors_in(&line, |mender, tree| {
                problems_of(timed(mender, tree), |timed| &timed.command, file, trial)
            }),
        };
        let Some(errors) = errors.map(|errors| errors.moved(number)) else { continue };
        match &mut all {
            Some(all) => all.append(errors),
            None => all = Some(errors),
        }
    }
    all
}

/// The ids of the commands of a journal that were rejected.
fn rejected(text: &str, file: &str) -> HashSet<String> {
    let entry = |(_, line)| Document::read(line, file).ok()?.value::<JournalEntry>().ok();
    let rejected = |entry: &JournalEntry| entry.status == OrderStatus::Rejected;
    lines(text).filter_map(entry).filter(rejected).map(|entry| entry.id).collect()
}

fn configuration(mender: &mut Mender<'_>, tree: &mut Node, trial: &mut Tried<'_>) {
    let mut unread = Unread::default();
    let pipelines = take_list(tree, "pipelines");
    let Piece { mut value, lacks } = mender.read::<Config>(tree);
    unread.of_configuration = lacks || value.is_none();
    if value.is_none() {
        let version = ("version", Value::Number(Number::from(1)));
        if rescue(tree, &["version", "pipelines"], vec![version]) {
            value = mender.read(tree).value;
        }
    }
    let mut read = Vec::new();
    if let Some(mut list) = pipelines {
        let pieces =
            mender.items(&mut list.node, |mender, node| pipeline(mender, node, &mut unread));
        for Piece { value, lacks } in pieces {
            let Some(value) = value else { continue };
            if lacks {
                unread.pipelines.insert(read.len());
            }
            read.push(value);
        }
        list.put_back(tree);
    }
    // Without the settings the pipelines can be looked at all the same.
    let Some(mut config) = value else { return };
    config.pipelines = read;
    let problems = config.problems_beside(&unread).into_problems();
    if let Some(trial) = trial {
        resolve_pipeline_files(&mut config.pipelines, mender.file());
        // A condition is not needed for that.
        let in_part = problems.iter().filter(|problem| problem.part().is_some());
        let faulty: HashSet<usize> = in_part.filter_map(Problem::pipeline).collect();
        let is_sound = |index: usize| unread.is_whole(index) && !faulty.contains(&index);
        for problem in trial.configuration(&config, &is_sound) {
            mender.note_problem(problem, tree);
        }
    }
    for problem in problems {
        if !problem.unmeasured().is_some_and(|name| unread.may_measure(name)) {
            mender.note_problem(problem, tree);
        }
    }
}

/// Reads a pipeline, each stage and action by itself.
pub(super) fn pipeline(
    mender: &mut Mender<'_>,
    node: &mut Node,
    unread: &mut Unread,
) -> Piece<Pipeline> {
    let stages = take_list(node, "stages");
    let then = take_list(node, "then");
    let Piece { mut value, mut lacks } = mender.read::<Pipeline>(node);
    if value.is_none() {
        lacks = true;
        // A name that no other pipeline has.
        let name = Value::String(format!("\0{}", node.span.start));
        let missing = vec![("name", name), ("stages", Value::Array(Vec::new()))];
        if rescue(node, &["name", "channel", "stages", "when", "then"], missing) {
            value = mender.read(node).value;
        }
    }
    let stages = of_list(mender, node, stages, |mender, node| {
        let piece = mender.read::<Stage>(node);
        if piece.lacks || piece.value.is_none() {
            unread.monitors.extend(names_in(node));
        }
        piece
    });
    let then = of_list(mender, node, then, |mender, node| mender.read::<Action>(node));
    let lacks_stage = stages.iter().any(|stage| stage.value.is_none());
    if lacks_stage {
        // What another measures may be more where the one that is lacking takes faces.
        let read = stages.iter().filter_map(|stage| stage.value.as_ref());
        let monitors = read.flat_map(|stage| monitors_of(stage, true));
        unread.monitors.extend(monitors.map(|monitor| monitor.name));
    }
    lacks |= lacks_stage;
    lacks |= then.iter().any(|action| action.value.is_none());
    if let Some(pipeline) = &mut value {
        pipeline.stages = stages.into_iter().filter_map(|stage| stage.value).collect();
        pipeline.then = then.into_iter().filter_map(|action| action.value).collect();
    }
    Piece { value, lacks }
}

/// Reads the items of a list that was taken out of an object, and puts it back.
fn of_list<T>(
    mender: &mut Mender<'_>,
    object: &mut Node,
    list: Option<Taken>,
    read: impl FnMut(&mut Mender<'_>, &mut Node) -> Piece<T>,
) -> Vec<Piece<T>> {
    let Some(mut list) = list else { return Vec::new() };
    let pieces = mender.items(&mut list.node, read);
    list.put_back(object);
    pieces
}

/// The prefixes of a stage's monitors: its key, its name and its field.
fn names_in(stage: &Node) -> Vec<String> {
    let mut names = Vec::new();
    for member in stage.members() {
        names.push(member.key.clone());
        for key in ["name", "field"] {
            if let Some(Value::String(name)) = member.node.member(key).map(|it| &it.node.value) {
                names.push(name.clone());
            }
        }
    }
    names
}

fn timed(mender: &mut Mender<'_>, node: &mut Node) -> Piece<TimedCommand> {
    command(mender, node, |timed: &mut TimedCommand, order| timed.command = order)
}

/// Reads something that holds a command, its order by itself.
fn command<T: DeserializeOwned>(
    mender: &mut Mender<'_>,
    node: &mut Node,
    set: impl FnOnce(&mut T, Command),
) -> Piece<T> {
    let is_object = |value: &Value| matches!(value, Value::Object(_));
    let taken = take(node, "order", is_object, undo());
    let mut piece = mender.read::<T>(node);
    let Some(mut taken) = taken else { return piece };
    let read = order(mender, &mut taken.node);
    taken.put_back(node);
    match (&mut piece.value, read.value) {
        (Some(value), Some(order)) => set(value, Command::Order(order)),
        _ => piece.value = None,
    }
    piece
}

/// The shortest order there is.
fn undo() -> Value {
    let node = Node { span: 0..0, value: Value::Number(Number::from(1)) };
    Value::Object(vec![Member { key: "undo".into(), key_span: 0..0, node }])
}

fn order(mender: &mut Mender<'_>, node: &mut Node) -> Piece<Order> {
    let lists = ["edits", "stack"].map(|key| take_list(node, key));
    let mut piece = mender.read::<Order>(node);
    let mut edits = Vec::new();
    for list in lists {
        let read = of_list(mender, node, list, |mender, node| mender.read::<Edit>(node));
        let lacks = read.iter().any(|edit| edit.value.is_none());
        piece.lacks |= lacks;
        edits.extend(read.into_iter().filter_map(|edit| edit.value));
    }
    match piece.value.as_mut().map(|order| &mut order.change) {
        // Where none of its edits could be read, it is not as empty as it looks.
        Some(Change::Edits(_) | Change::Stack(_)) if piece.lacks && edits.is_empty() => {
            piece.value = None;
        }
        Some(Change::Edits(all) | Change::Stack(all)) => *all = edits,
        _ => {}
    }
    piece
}
