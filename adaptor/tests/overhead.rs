//! What `execute` costs when there is nothing to do.

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
};

use tombolo::{
    Adaptor, Settings, Step,
    deform::{mesh::MeshView, shapes::box_of_tets},
    pipelines::{
        extract::Channel,
        language::{parse, parse_orders},
    },
};

thread_local! {
    // Of each thread by itself: what is prepared beside the solver allocates as it likes.
    static ALLOCATIONS: Cell<u64> = const { Cell::new(0) };
}

struct Counting;

// SAFETY: every call is handed on to the system's allocator as it came.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.set(ALLOCATIONS.get() + 1);
        // SAFETY: the caller's promise is the system allocator's condition.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

#[test]
fn a_step_with_nothing_due_allocates_nothing() {
    let orders = r#"[{"at": {"cycle": 1000000000}, "order": {"stack": []}}]"#;
    let config = r#"{"version": 1, "pipelines": [
        {"name": "health", "at": {"cycle": 1000000000}, "stages": [{"quality": {}}]},
        {"name": "more", "every": {"time": 1e9}, "stages": [{"quality": {}}]},
        {"name": "slow", "every": {"seconds": 1e9}, "stages": [{"quality": {}}]},
        {"name": "hello", "on": "viewer", "stages": [{"quality": {}}]},
        {"name": "end", "on": "end", "stages": [{"log": {}}]}]}"#;
    let mut adaptor = Adaptor::initialize(Settings {
        config: parse(config, "overhead.json").unwrap(),
        orders: parse_orders(orders, "orders.json").unwrap(),
        ..Settings::default()
    })
    .unwrap();
    let mesh = box_of_tets([8, 8, 8], [0.0; 3], [1.0; 3]);
    let channels = [Channel { name: "fluid", mesh: MeshView::from(&mesh), fields: &[] }];
    let mut cycle = 0;
    let mut allocations_of = |steps: u64| {
        let before = ALLOCATIONS.get();
        for _ in 0..steps {
            let step = Step { cycle, time: cycle as f64 * 1e-3, time_step: 1e-3 };
            assert!(adaptor.execute(&step, &channels).unwrap().motion.is_none());
            cycle += 1;
        }
        ALLOCATIONS.get() - before
    };
    assert!(allocations_of(10) > 0, "the first steps set up");
    assert_eq!(allocations_of(200_000), 0);
}
