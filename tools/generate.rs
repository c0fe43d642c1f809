//! Makes the meshes of `scenes/grass` and `scenes/bust` with as many triangles as asked for:
//!
//! `cargo run --release --example generate -- grass --triangles 200000 -o scenes/grass/grass.obj`
//!
//! The same arguments give the same file: all randomness is a hash of integers.
use anyhow::{Context, ensure};
use clap::{Parser, ValueEnum};
use glam::{Vec2, Vec3, vec2, vec3};
use std::f32::consts::{PI, TAU};
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};

#[derive(Clone, Copy, ValueEnum)]
enum Subject {
    /// Bent blades on a square of 4 m x 4 m around the origin; five triangles each, flat.
    Grass,
    /// A head on shoulders, 1.21 m tall on y = 0, facing +z: one closed surface with smooth normals.
    Bust,
}

#[derive(Parser)]
#[command(about = "Makes a mesh with a settable number of triangles")]
struct Args {
    subject: Subject,
    /// Upper limit of the number of triangles, 100 to 100 million; the mesh has the nearest number below that its shape allows
    #[arg(long, default_value_t = 8000, value_parser = clap::value_parser!(u32).range(100..=100_000_000))]
    triangles: u32,
    /// OBJ file to write
    #[arg(short, long)]
    output: PathBuf,
}

/// Indexed triangles; `normals` is empty or as long as `positions`.
#[derive(Default)]
struct Mesh {
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let mesh = match args.subject {
        Subject::Grass => grass(args.triangles),
        Subject::Bust => bust(args.triangles),
    };
    ensure!(mesh.triangles.len() <= args.triangles as usize, "the mesh has more triangles than asked for");
    write_obj(&mesh, &args.output).with_context(|| format!("cannot write {}", args.output.display()))?;
    println!("{}: {} triangles", args.output.display(), mesh.triangles.len());
    Ok(())
}

/// Writes beside the file and renames, so that an interrupted run leaves the old file.
fn write_obj(mesh: &Mesh, path: &Path) -> anyhow::Result<()> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let file = tempfile::Builder::new().permissions(permissions()).tempfile_in(folder)?;
    let mut out = BufWriter::new(&file);
    writeln!(out, "# Made by tools/generate.rs. Metres, y up.")?;
    // A tenth of a millimetre is finer than the details of either subject.
    for p in &mesh.positions {
        writeln!(out, "v {:.4} {:.4} {:.4}", p.x, p.y, p.z)?;
    }
    for n in &mesh.normals {
        writeln!(out, "vn {:.3} {:.3} {:.3}", n.x, n.y, n.z)?;
    }
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| i + 1);
        match mesh.normals.is_empty() {
            true => writeln!(out, "f {a} {b} {c}")?,
            false => writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?,
        }
    }
    out.flush()?;
    drop(out);
    file.persist(path)?;
    Ok(())
}

/// The permissions of an ordinary new file; temporary files are private by default.
fn permissions() -> std::fs::Permissions {
    std::os::unix::fs::PermissionsExt::from_mode(0o644)
}

/// PCG's output permutation as a hash (Jarzynski and Olano 2020), chained over the words.
fn hash(words: &[u32]) -> u32 {
    words.iter().fold(0x9e37_79b9, |state, &word| {
        let s = (state ^ word).wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
        let w = ((s >> ((s >> 28) + 4)) ^ s).wrapping_mul(277_803_737);
        (w >> 22) ^ w
    })
}

/// Uniform in [0, 1), a function of the words alone.
fn uniform(words: &[u32]) -> f32 {
    (hash(words) >> 8) as f32 / (1 << 24) as f32
}

/// Side of the lawn in metres.
const LAWN: f32 = 4.0;
/// Triangles of a blade: two quads and a tip.
const BLADE: u32 = 5;

/// One blade in each cell of a jittered grid; when the grid has more cells than blades, the last cells stay bare.
fn grass(triangles: u32) -> Mesh {
    let blades = triangles / BLADE;
    let cells = (blades as f32).sqrt().ceil() as u32;
    let cell = LAWN / cells as f32;
    let mut mesh = Mesh::default();
    for i in 0..blades {
        let random = |dimension| uniform(&[i, dimension]);
        let corner = vec2((i % cells) as f32, (i / cells) as f32);
        let root = (corner + vec2(random(0), random(1))) * cell - Vec2::splat(LAWN / 2.0);
        let width = (0.4 * cell).clamp(0.004, 0.03) * (0.7 + 0.6 * random(2));
        add_blade(&mut mesh, root, width, 0.18 + 0.22 * random(3), random(4) * TAU, 0.3 + 0.9 * random(5));
    }
    mesh
}

/// `lean` is the angle in radians by which the tip has turned away from the vertical towards `heading`.
fn add_blade(mesh: &mut Mesh, root: Vec2, width: f32, height: f32, heading: f32, lean: f32) {
    let (forward, side) = (vec3(heading.cos(), 0.0, heading.sin()), vec3(-heading.sin(), 0.0, heading.cos()));
    let first = mesh.positions.len() as u32;
    for level in 0..3 {
        let t = level as f32 / 3.0;
        let spine = blade_spine(root, height, lean, t, forward);
        let half = side * (0.5 * width * (1.0 - 0.6 * t));
        mesh.positions.extend([spine - half, spine + half]);
    }
    mesh.positions.push(blade_spine(root, height, lean, 1.0, forward));
    for quad in [first, first + 2] {
        mesh.triangles.extend([[quad, quad + 1, quad + 3], [quad, quad + 3, quad + 2]]);
    }
    mesh.triangles.push([first + 4, first + 5, first + 6]);
}

/// A circular arc of length `height` that starts upright and has turned by `lean` at t = 1.
fn blade_spine(root: Vec2, height: f32, lean: f32, t: f32, forward: Vec3) -> Vec3 {
    let radius = height / lean;
    let angle = lean * t;
    vec3(root.x, radius * angle.sin(), root.y) + forward * (radius * (1.0 - angle.cos()))
}

/// Cross-sections of the bust from below to above: height, half width, half depth, centre in z; metres.
const PROFILE: [[f32; 4]; 14] = [
    [0.00, 0.000, 0.000, 0.000],
    [0.00, 0.340, 0.220, 0.000],
    [0.20, 0.470, 0.265, 0.000],
    [0.36, 0.430, 0.215, -0.020],
    [0.43, 0.260, 0.165, -0.025],
    [0.52, 0.140, 0.145, -0.015],
    [0.66, 0.155, 0.180, 0.020],
    [0.74, 0.180, 0.225, 0.030],
    [0.86, 0.210, 0.250, 0.020],
    [0.98, 0.225, 0.265, 0.000],
    [1.08, 0.215, 0.255, -0.010],
    [1.16, 0.165, 0.200, -0.015],
    [1.20, 0.090, 0.105, -0.020],
    [1.21, 0.000, 0.000, -0.020],
];

/// Features of the face: height, angle from the front in radians, extent in both, displacement in metres.
/// Those off the middle appear on both sides.
const FEATURES: [[f32; 5]; 9] = [
    [0.850, 0.00, 0.040, 0.13, 0.060],  // nose
    [0.910, 0.00, 0.050, 0.10, 0.022],  // bridge
    [0.935, 0.40, 0.028, 0.20, -0.030], // eye sockets
    [0.935, 0.40, 0.014, 0.11, 0.016],  // eyes
    [0.985, 0.34, 0.018, 0.30, 0.014],  // brows
    [0.785, 0.00, 0.012, 0.26, 0.016],  // upper lip
    [0.750, 0.00, 0.012, 0.22, 0.014],  // lower lip
    [0.690, 0.00, 0.028, 0.24, 0.020],  // chin
    [0.900, 1.62, 0.055, 0.10, 0.035],  // ears
];

/// A grid of `rows` rings of `columns` vertices and a pole at each end: `2 * columns * rows` triangles.
fn bust(triangles: u32) -> Mesh {
    // The profile is about as long as the mean circumference, so this makes the triangles roughly equilateral.
    let columns = ((triangles as f32 / 2.0).sqrt() as u32).max(3);
    let rows = triangles / (2 * columns);
    let mut mesh = Mesh::default();
    mesh.positions.push(bust_point(0.0, 0.0));
    for row in 0..rows {
        let height = (row + 1) as f32 / (rows + 1) as f32;
        mesh.positions.extend((0..columns).map(|c| bust_point(height, c as f32 / columns as f32 * TAU)));
    }
    mesh.positions.push(bust_point(1.0, 0.0));
    let at = |row: u32, column: u32| 1 + row * columns + column % columns;
    let top = 1 + rows * columns;
    for c in 0..columns {
        mesh.triangles.push([0, at(0, c + 1), at(0, c)]);
        mesh.triangles.push([top, at(rows - 1, c), at(rows - 1, c + 1)]);
        for row in 1..rows {
            let [a, b, d, e] = [at(row - 1, c), at(row - 1, c + 1), at(row, c), at(row, c + 1)];
            mesh.triangles.extend([[a, b, e], [a, e, d]]);
        }
    }
    mesh.normals = vertex_normals(&mesh);
    mesh
}

/// `along` in [0, 1] runs from the middle of the base to the crown, `angle` from the front (+z) towards +x.
fn bust_point(along: f32, angle: f32) -> Vec3 {
    let [height, half_width, half_depth, centre] = profile(along);
    let outward = vec3(angle.sin(), 0.0, angle.cos());
    let on_profile = vec3(half_width * outward.x, height, centre + half_depth * outward.z);
    // Displacement fades towards both poles, where all angles meet in one point.
    let fade = (half_width / 0.1).min(1.0);
    on_profile + outward * (fade * displacement(on_profile, angle))
}

/// Catmull-Rom interpolation of `PROFILE`, `along` being the share of the polyline's length.
fn profile(along: f32) -> [f32; 4] {
    let point = |i: usize| PROFILE[i.min(PROFILE.len() - 1)];
    let length = |i: usize| (0..3).map(|k| (point(i + 1)[k] - point(i)[k]).powi(2)).sum::<f32>().sqrt();
    let mut rest = along * (0..PROFILE.len() - 1).map(length).sum::<f32>();
    let mut i = 0;
    while i + 2 < PROFILE.len() && rest > length(i) {
        rest -= length(i);
        i += 1;
    }
    let t = (rest / length(i)).min(1.0);
    let (p0, p1, p2, p3) = (point(i.saturating_sub(1)), point(i), point(i + 1), point(i + 2));
    std::array::from_fn(|k| {
        let bend = [
            2.0 * p1[k],
            p2[k] - p0[k],
            2.0 * p0[k] - 5.0 * p1[k] + 4.0 * p2[k] - p3[k],
            3.0 * (p1[k] - p2[k]) + p3[k] - p0[k],
        ];
        let value = 0.5 * (bend[0] + t * (bend[1] + t * (bend[2] + t * bend[3])));
        // The spline overshoots at the poles, where a negative radius would turn the surface inside out.
        if k == 1 || k == 2 { value.max(0.0) } else { value }
    })
}

/// Metres outwards: the face, hair behind and above it, and weathered stone everywhere.
fn displacement(p: Vec3, angle: f32) -> f32 {
    let turn = (angle + PI).rem_euclid(TAU) - PI;
    let face = FEATURES.iter().map(|&[height, place, tall, wide, size]| {
        let x = (turn.abs() - place) / wide;
        let y = (p.y - height) / tall;
        size * (-(x * x + y * y)).exp()
    });
    let hair = smoothstep(0.72, 0.80, p.y) * smoothstep(0.9, 1.25, turn.abs()).max(smoothstep(1.03, 1.08, p.y));
    face.sum::<f32>() + hair * 0.05 * ridges(p * vec3(14.0, 9.0, 14.0)) + 0.006 * fractal(p * 18.0)
}

fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// Trilinear value noise in [-1, 1].
fn noise(p: Vec3) -> f32 {
    let cell = p.floor();
    let t = p - cell;
    let t = t * t * (3.0 - 2.0 * t);
    let corner = |dx: i32, dy: i32, dz: i32| {
        let word = |origin: f32, step: i32| (origin as i32 + step) as u32;
        2.0 * uniform(&[word(cell.x, dx), word(cell.y, dy), word(cell.z, dz)]) - 1.0
    };
    let mix = |a: f32, b: f32, t: f32| a + (b - a) * t;
    let along_x = |dy, dz| mix(corner(0, dy, dz), corner(1, dy, dz), t.x);
    mix(mix(along_x(0, 0), along_x(1, 0), t.y), mix(along_x(0, 1), along_x(1, 1), t.y), t.z)
}

/// Five octaves, each half as high as the one before.
fn fractal(p: Vec3) -> f32 {
    (0..5).map(|octave| noise(p * (1 << octave) as f32) / (1 << octave) as f32).sum()
}

/// Sharp crests at the zeros of the noise, in [0, 1].
fn ridges(p: Vec3) -> f32 {
    (1.0 - noise(p).abs()).powi(2)
}

/// Means of the adjoining faces' normals, weighted by area.
fn vertex_normals(mesh: &Mesh) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; mesh.positions.len()];
    for t in &mesh.triangles {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        let doubled_area = (b - a).cross(c - a);
        t.iter().for_each(|&i| sums[i as usize] += doubled_area);
    }
    sums.into_iter().map(Vec3::normalize_or_zero).collect()
}
