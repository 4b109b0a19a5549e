//! The paper's edit of the bypass: the angle at which it comes back into the artery, made about 15
//! degrees less by one drag of the skeleton.

use std::process::Command;

use serde_json::Value;
use tombolo_deform::features::FeatureSettings;
use tombolo_deform::mesh::Vector;
use tombolo_deform::surface::Surface;
use tombolo_pipelines::files::read_mesh;
use tombolo_tests::{gallery, generated_mesh, project, succeed, target, tombolo};

const MESH: &str = "meshes/bypass-0.msh";

/// The angle in degrees between the artery, along x, and the axis of the bypass where it comes
/// back: the line through the centres of the cuts in the planes y = 8.5 to 13.5 mm.
fn outlet_angle(triangles: &[[u32; 3]], points: &[Vector]) -> f64 {
    let centres: Vec<[f64; 2]> = (0..=10)
        .map(|cut| 0.0085 + 0.0005 * f64::from(cut))
        .map(|height| {
            let (mut sum, mut length) = ([0.0; 2], 0.0);
            for corners in
                triangles.iter().map(|triangle| triangle.map(|vertex| points[vertex as usize]))
            {
                let cuts: Vec<Vector> = (0..3)
                    .map(|side| [corners[side], corners[(side + 1) % 3]])
                    .filter(|[a, b]| (a[1] < height) != (b[1] < height))
                    .map(|[a, b]| {
                        let t = (height - a[1]) / (b[1] - a[1]);
                        [0, 1, 2].map(|axis| a[axis] + t * (b[axis] - a[axis]))
                    })
                    .collect();
                // Half way along x the bypass is high above.
                if let [a, b] = cuts[..]
                    && a[0] > 0.05
                {
                    let weight = (0..3).map(|axis| (a[axis] - b[axis]).powi(2)).sum::<f64>().sqrt();
                    length += weight;
                    for axis in 0..2 {
                        sum[axis] += 0.5 * weight * (a[axis] + b[axis]);
                    }
                }
            }
            sum.map(|value| value / length)
        })
        .collect();
    let mean = [0, 1]
        .map(|axis| centres.iter().map(|centre| centre[axis]).sum::<f64>() / centres.len() as f64);
    let slope =
        centres.iter().map(|centre| (centre[0] - mean[0]) * (centre[1] - mean[1])).sum::<f64>()
            / centres.iter().map(|centre| (centre[1] - mean[1]).powi(2)).sum::<f64>();
    1.0f64.atan2(-slope).to_degrees()
}

#[test]
fn vtk_reads_the_skeleton_that_the_program_writes() {
    let _ = generated_mesh("bypass-0");
    let directory = tempfile::tempdir().expect("a directory");
    let out = directory.path().join("skeleton.vtp");
    let output =
        tombolo(&["skeleton", "--mesh", MESH, "--out", out.to_str().expect("text"), "--json"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_slice(&output.stdout).expect("a report");
    let count = |name: &str| report[name].as_u64().expect("a count") as usize;
    assert_eq!(
        ["components", "loops", "branches", "ends", "curves"].map(count),
        [1, 1, 2, 2, 4],
        "{report}"
    );
    if std::env::var_os("TOMBOLO_WITHOUT_VTK").is_some() {
        eprintln!("skipped: TOMBOLO_WITHOUT_VTK is set, so VTK reads nothing");
        return;
    }
    let read = Command::new("/usr/bin/python3")
        .arg(project().join("tests/vtk/read_back.py"))
        .arg(&out)
        .output()
        .expect("python3 starts");
    assert!(
        read.status.success(),
        "VTK (apt-get install python3-vtk9): {}",
        String::from_utf8_lossy(&read.stderr)
    );
    let text = String::from_utf8(read.stdout).expect("text");
    let values = |start: &str| -> Vec<f64> {
        let line = text
            .lines()
            .find_map(|line| line.strip_prefix(start))
            .unwrap_or_else(|| panic!("no {start}"));
        let bits = |word: &str| f64::from_bits(u64::from_str_radix(word, 16).expect("a number"));
        line.split_ascii_whitespace().map(bits).collect()
    };
    // Polylines are cells of VTK's kind 4.
    let polylines: Vec<usize> = text
        .lines()
        .filter_map(|line| line.strip_prefix("cell 4"))
        .map(|nodes| nodes.split_whitespace().count())
        .collect();
    assert_eq!(polylines.len(), count("curves"));
    assert_eq!(
        polylines.iter().map(|nodes| nodes - 1).sum::<usize>(),
        count("nodes"),
        "as many segments as nodes: one loop"
    );
    assert_eq!(values("points").len(), 3 * count("nodes"));
    let degrees = values("point \"degree\" 1");
    let of_degree = |wanted: f64| degrees.iter().filter(|&&degree| degree == wanted).count();
    assert_eq!([of_degree(1.0), of_degree(3.0)], ["ends", "branches"].map(count));
    assert_eq!(
        values("point \"node\" 1"),
        (0..count("nodes")).map(|node| node as f64).collect::<Vec<_>>()
    );
    assert_eq!(values("cell \"curve\" 1"), [0.0, 1.0, 2.0, 3.0]);
    // The artery has a radius of 6.6 mm and less where it is narrow.
    assert!(values("point \"radius\" 1").iter().all(|radius| (0.001..0.012).contains(radius)));
}

#[test]
fn one_drag_of_the_skeleton_makes_the_outlet_of_the_bypass_less_steep() {
    let _ = generated_mesh("bypass-0");
    // The order that the demo replays.
    let orders = std::fs::read_to_string(project().join("examples/flow/orders/bypass-angle.json"))
        .expect("the order");
    let orders: Value = serde_json::from_str(&orders).expect("JSON");
    assert_eq!(orders[0]["order"]["edits"].as_array().map(Vec::len), Some(1));

    let directory = tempfile::tempdir().expect("a directory");
    let [edits, out] = ["edits.json", "out.vtu"].map(|name| directory.path().join(name));
    std::fs::write(&edits, orders[0]["order"].to_string()).expect("written");
    let [edits, out] = [&edits, &out].map(|path| path.to_str().expect("text"));
    let output = tombolo(&["edit", "--mesh", MESH, "--edits", edits, "--out", out, "--json"]);
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
    let report: Value = serde_json::from_str(&text).expect("a report");
    assert_eq!(
        (&report["status"], &report["inverted"]),
        (&"applied".into(), &0.into()),
        "{report}"
    );

    let [before, after] =
        [project().join(MESH), out.into()].map(|path| read_mesh(&path).expect("a mesh").mesh);
    let surface = Surface::extract(&before, &FeatureSettings::default()).expect("a surface");
    let points: Vec<Vector> =
        surface.vertices().iter().map(|&vertex| after.points()[vertex as usize]).collect();
    for name in ["artery", "inlet", "outlet"] {
        let feature = surface.features().index(name).expect("a feature");
        for &vertex in surface.features().vertices(feature) {
            assert_eq!(
                points[vertex as usize],
                surface.points()[vertex as usize],
                "{name} has moved"
            );
        }
    }
    let [before, after] =
        [surface.points(), &points].map(|points| outlet_angle(surface.triangles(), points));
    assert!((11.0..19.0).contains(&(before - after)), "from {before:.1} to {after:.1} degrees");
}

#[test]
fn the_bypass_is_drawn_before_and_after() {
    let _ = generated_mesh("bypass-0");
    let picture = gallery("bypass-angle.png");
    let mut draw = Command::new(project().join("scripts/pictures"));
    draw.arg("--out").arg(picture.parent().expect("a folder"));
    succeed(
        draw.args(["bypass", "--program"]).arg(target().join("debug/examples/skeleton_picture")),
    );
    assert!(picture.exists());
}
