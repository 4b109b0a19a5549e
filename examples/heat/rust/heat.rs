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
        let mut velocity = vec![[0.0; 3]; points.len()];
        if let Some(motion) = steering.motion {
            points.copy_from_slice(&motion.coordinates);
            velocity.copy_from_slice(&motion.velocity);
        }
        if steering.stop {
            break;
        }
        let heating = adaptor.parameter("heating").unwrap_or(1.0);
        conduct(&points, &tets, &velocity, &mut temperature, heating, time_step);
    }
    let report = adaptor.finalize()?;
    // In this order a temperature that is no number comes last.
    let warmest = temperature.iter().copied().max_by(f64::total_cmp).unwrap_or(0.0);
    println!("{} orders, warmest {warmest:.6}", report.orders.len());
    Ok(())
}

/// One step of heat conduction with linear tetrahedra and lumped capacities, on a mesh that moves at
/// `velocity`; the box is heated everywhere, and cold where it was at z = 0.
fn conduct(
    points: &[[f64; 3]],
    tets: &[u32],
    velocity: &[[f64; 3]],
    temperature: &mut [f64],
    heating: f64,
    time_step: f64,
) {
    let tets = tets.as_chunks::<4>().0;
    let elements: Vec<_> = tets.iter().map(|tet| shape(tet.map(|v| points[v as usize]))).collect();
    // Explicit steps are stable up to a length that the smallest tetrahedron and the fastest vertex
    // set: a step is taken in as many parts as that needs.
    let square = |vector: &[f64; 3]| dot(*vector, *vector);
    let smallest = elements
        .iter()
        .map(|(_, gradients)| gradients.iter().map(square).sum::<f64>())
        .fold(0.0, f64::max);
    let fastest = velocity.iter().map(square).fold(0.0, f64::max);
    let parts = (time_step * (2.0 * smallest + 0.5 * fastest)).ceil().max(1.0);
    for _ in 0..parts as usize {
        let (mut flux, mut capacity) = (vec![0.0; points.len()], vec![0.0; points.len()]);
        for (tet, (volume, gradients)) in tets.iter().zip(&elements) {
            let tet = tet.map(|vertex| vertex as usize);
            let slope =
                [0, 1, 2].map(|k| (0..4).map(|i| temperature[tet[i]] * gradients[i][k]).sum());
            // A vertex that moves passes through the temperature: the term of the moving mesh.
            let along: f64 = tet.iter().map(|&vertex| 0.25 * dot(velocity[vertex], slope)).sum();
            for (vertex, own) in tet.into_iter().zip(gradients) {
                flux[vertex] += volume * (0.25 * along - dot(slope, *own));
                capacity[vertex] += 0.25 * volume;
            }
        }
        // The floor: the first layer of vertices, wherever orders have moved it.
        let floor = 13 * 13;
        for vertex in floor..points.len() {
            temperature[vertex] += time_step / parts * (flux[vertex] / capacity[vertex] + heating);
        }
    }
}

/// The volume of a tetrahedron, and the gradients of its four hat functions.
fn shape([a, b, c, d]: [[f64; 3]; 4]) -> (f64, [[f64; 3]; 4]) {
    let [u, v, w] = [b, c, d].map(|p| [p[0] - a[0], p[1] - a[1], p[2] - a[2]]);
    let six_volumes = dot(u, cross(v, w));
    let [gb, gc, gd] = [cross(v, w), cross(w, u), cross(u, v)].map(|g| g.map(|x| x / six_volumes));
    (six_volumes / 6.0, [[0, 1, 2].map(|k| -gb[k] - gc[k] - gd[k]), gb, gc, gd])
}

fn cross(p: [f64; 3], q: [f64; 3]) -> [f64; 3] {
    [p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]]
}

fn dot(p: [f64; 3], q: [f64; 3]) -> f64 {
    p[0] * q[0] + p[1] * q[1] + p[2] * q[2]
}
