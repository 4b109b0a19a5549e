//! Heat in a box that is watched and reshaped while it spreads: the smallest whole solver in Rust.
//!
//! ```sh
//! cargo run --release --example heat -- examples/heat/rust/pipelines.json      # open the link it tells
//! cargo run --release --example heat -- examples/heat/rust/pipelines.json 100  # a hundred steps, and no more
//! ```

use std::{error::Error, io::IsTerminal};

use tombolo::{Adaptor, Channel, FieldView, MeshView, Step, deform::shapes::box_of_tets};

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let file = arguments.next().ok_or("expected a file of pipelines")?;
    let steps: u64 = arguments.next().map_or(Ok(u64::MAX), |steps| steps.parse())?;

    let mesh = box_of_tets([12, 12, 12], [0.0; 3], [1.0; 3]);
    let (mut points, tets) = (mesh.points().to_vec(), mesh.cells().connectivity().to_vec());
    let mut temperature = vec![0.0; points.len()];

    let mut adaptor = Adaptor::from_file(&file)?.parameter("heating", 1.0, 0.0..=10.0).start()?;
    if let Some(invitation) = adaptor.invitation(std::io::stdout().is_terminal())? {
        println!("heat: {invitation}");
    }
    let time_step = 1e-3;
    for cycle in 0..steps {
        let fields = [FieldView::vertex("temperature", &temperature)];
        let solid = Channel::new("solid", MeshView::tets(&points, &tets), &fields);
        let time = cycle as f64 * time_step;
        let steering = adaptor.execute(&Step { cycle, time, time_step }, &[solid])?;
        if let Some(motion) = steering.motion {
            points.copy_from_slice(&motion.coordinates);
        }
        if steering.stop {
            break;
        }
        conduct(
            &points,
            &tets,
            &mut temperature,
            adaptor.parameter("heating").unwrap_or(1.0),
            time_step,
        );
    }
    let report = adaptor.finalize()?;
    println!(
        "{} orders, warmest {:.6}",
        report.orders.len(),
        temperature.iter().fold(0.0_f64, |most, &t| most.max(t))
    );
    Ok(())
}

/// One explicit step of heat conduction with linear tetrahedra and lumped capacities; the box is
/// heated everywhere, and cold where it was at z = 0.
fn conduct(
    points: &[[f64; 3]],
    tets: &[u32],
    temperature: &mut [f64],
    heating: f64,
    time_step: f64,
) {
    let (mut flux, mut capacity) = (vec![0.0; points.len()], vec![0.0; points.len()]);
    for tet in tets.as_chunks::<4>().0 {
        let [a, b, c, d] = tet.map(|vertex| points[vertex as usize]);
        let [u, v, w] = [b, c, d].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
        let cross = |p: [f64; 3], q: [f64; 3]| {
            [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
        };
        let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
        let six_volumes = dot(u, cross(v, w));
        let [gb, gc, gd] =
            [cross(v, w), cross(w, u), cross(u, v)].map(|g| g.map(|x| x / six_volumes));
        let gradients = [[0, 1, 2].map(|k| -gb[k] - gc[k] - gd[k]), gb, gc, gd];
        let gradient =
            [0, 1, 2].map(|k| (0..4).map(|i| temperature[tet[i] as usize] * gradients[i][k]).sum());
        for (&vertex, own) in tet.iter().zip(gradients) {
            flux[vertex as usize] -= six_volumes / 6.0 * dot(gradient, own);
            capacity[vertex as usize] += six_volumes / 24.0;
        }
    }
    // The floor: the first layer of vertices, wherever orders have moved it.
    let floor = 13 * 13;
    for vertex in floor..points.len() {
        temperature[vertex] += time_step * (flux[vertex] / capacity[vertex] + heating);
    }
}
