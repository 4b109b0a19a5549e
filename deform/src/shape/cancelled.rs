//! Plans that are given up, at each place where they can be: on one process and on several ranks.

use serde_json::json;

use super::tests::{alone, asked, of_part, stack};
use super::*;
use crate::communicator::threads;
use crate::distributed::Part;
use crate::distributed::tests::dealt;
use crate::quality::Otherwise;
use crate::shapes::box_of_tets;

fn mesh() -> Mesh {
    box_of_tets([3, 3, 6], [0.0; 3], [1.0, 1.0, 2.0])
}

/// The ends of these orders are not reached by one solve: the first by sub-steps, some of which
/// are untangled, the second not at all.
fn orders() -> [Vec<Edit>; 2] {
    let turned = json!([{"rotate": {
        "features": ["z-max"], "fixed": ["z-min"], "axis": [0, 0, 1], "degrees": 150}}]);
    let beyond = json!([{"translate": {
        "features": ["z-max"], "fixed": ["z-min"], "by": [0.0, 0.0, -2.5], "harmonic_order": 1}}]);
    [stack(turned), stack(beyond)]
}

fn request(shaper: &Shaper, edits: &[Edit]) -> Request {
    let guard = Guard {
        min_scaled_jacobian: 0.03,
        otherwise: Otherwise::Untangle,
        surface: SurfaceRule::Allow,
    };
    Request { guard, ..asked(shaper, edits, &Deformation::default()) }
}

/// The shapes of a plan as bits, or why there is none.
type Outcome = Result<Vec<Vec<u64>>, String>;

fn outcome(plan: Result<Plan, Refused>) -> Outcome {
    let of_shape =
        |shape: &Arc<[Vector]>| shape.as_flattened().iter().map(|value| value.to_bits()).collect();
    plan.map(|plan| plan.way().iter().map(of_shape).collect())
        .map_err(|refused| refused.to_string())
}

/// Plans each order; has it given up at each of `tried` looks of rank 0, then made anew by the same
/// shaper. What one rank is given up at the others are too, or two ranks would call different
/// things, which [`threads`] tells.
fn given_up_everywhere(fresh: &dyn Fn() -> Shaper, tried: &dyn Fn(usize) -> Vec<usize>) {
    for edits in orders() {
        let mut shaper = fresh();
        let expected = outcome(shaper.plan(&request(&shaper, &edits)));
        let ranks = Arc::clone(shaper.domain().communicator());
        let is_first = ranks.rank() == 0;
        let looks = ranks.most(if is_first { shaper.cancellation().looks() } else { 0 });
        assert!(looks > 200, "{looks} looks");
        for look in tried(looks) {
            let mut shaper = fresh();
            let cancellation = shaper.cancellation().clone();
            cancellation.cancel_at(if is_first { look } else { 0 });
            let plan = shaper.plan(&request(&shaper, &edits));
            let is_given_up = plan.as_ref().is_err_and(Refused::is_cancelled);
            // Behind the last reduction of a plan nobody hears of it.
            let is_over = ranks.size() > 1 && look == looks && outcome(plan) == expected;
            assert!(is_given_up || is_over, "look {look} of {looks}");
            cancellation.cancel_at(0);
            cancellation.renew();
            let again = outcome(shaper.plan(&request(&shaper, &edits)));
            assert!(again == expected, "given up at look {look} of {looks}, it has other bits");
        }
    }
}

/// Whatever a plan is at when it is given up, it says so, and leaves nothing behind that the next
/// one finds.
#[test]
fn a_plan_is_given_up_at_each_look_and_made_anew_to_the_same_bits() {
    let mesh = mesh();
    // Iterations of a solve look very often, and are all alike.
    let tried = |looks: usize| {
        let step = looks.div_ceil(120);
        (1..=looks).filter(|look| look % step == 0 || look + 20 > looks).collect()
    };
    given_up_everywhere(&|| alone(&mesh), &tried);
}

#[test]
fn ranks_give_a_plan_up_at_the_same_look() {
    let mesh = mesh();
    for (count, empty) in [(2, None), (3, Some(1))] {
        let of_cells = dealt(&mesh, count, empty);
        threads::run(count, |ranks| {
            let part = Part::cut(&mesh, &of_cells, ranks.rank(), false).unwrap();
            let ranks: Arc<dyn Communicator> = Arc::new(ranks);
            let tried = |looks: usize| {
                let step = looks.div_ceil(8);
                (1..=looks).filter(|look| look % step == 0 || *look == looks).collect()
            };
            given_up_everywhere(&|| of_part(&ranks, &part), &tried);
        });
    }
}

/// Where it is given up, untangling makes no step: of a mesh of any size it takes a look.
#[test]
fn what_is_given_up_is_not_untangled() {
    let mesh = box_of_tets([6, 6, 6], [0.0; 3], [1.0; 3]);
    let shaper = alone(&mesh);
    let inside: Vec<u32> = {
        let boundary = shaper.boundary_vertices();
        (0..mesh.points().len() as u32).filter(|vertex| !boundary.contains(vertex)).collect()
    };
    let mut thrown = mesh.points().to_vec();
    for &vertex in &inside {
        thrown[vertex as usize][0] += 0.3 * (12.9898 * f64::from(vertex)).sin();
    }
    let cancellation = Cancellation::default();
    let untangler = crate::volume::Untangler::new(&mesh, shaper.boundary_vertices())
        .with_cancellation(cancellation.clone());
    cancellation.cancel();
    let mut points = thrown.clone();
    assert!(!untangler.untangle(&mut points, 0.0));
    assert_eq!(points, thrown);
    assert!(cancellation.looks() < 10, "{}", cancellation.looks());
    cancellation.renew();
    assert!(untangler.untangle(&mut points, 0.0));
}
