//! Placement, repair and packing of single triangles.
use super::*;
use glam::vec4;

const PLAIN: Placement = Placement { affine: DAffine3::IDENTITY, flat: false, flip: false, uvs: true, keep: false };
const TAG: Tag = Tag { primitive: 0, material: 0, object: 0 };
const P: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

fn push(c: Corners, at: Placement) -> (Geometry, Repairs) {
    let (mut g, mut r) = Default::default();
    Geometry::push(&mut g, &c, TAG, &at, &mut r).unwrap();
    (g, r)
}

#[test]
fn normals_survive_packing() {
    let mut worst = 0f32;
    for i in 0..10_000 {
        let (z, phi) = (1.0 - (i as f32 + 0.5) / 5000.0, i as f32 * 2.399_963);
        let n = Vec3::new(phi.cos(), phi.sin(), 0.0) * (1.0 - z * z).sqrt() + Vec3::Z * z;
        worst = worst.max(decode_normal(encode_normal(n)).distance(n));
    }
    assert!(worst < 7e-5, "{worst}");
    for n in [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z] {
        assert_eq!(decode_normal(encode_normal(n)), n);
    }
}

#[test]
fn normals_equal_to_the_face_are_flat_and_others_are_not() {
    let face = Corners { p: P, n: Some([Vec3::Z * 3.0; 3]), uv: None, extras: Extras::default() };
    assert!(push(face, PLAIN).0.shading.is_empty());
    let bent = Corners { n: Some([Vec3::Z, Vec3::Z, Vec3::new(0.1, 0.0, 1.0)]), ..face };
    assert_eq!(push(bent, PLAIN).0.shading.len(), 1);
    assert!(push(bent, Placement { flat: true, ..PLAIN }).0.shading.is_empty());
}

#[test]
fn a_mirror_keeps_the_outside_outside() {
    let affine = DAffine3::from_scale(DVec3::new(-1.0, 1.0, 1.0));
    let face =
        Corners { p: P, n: Some([Vec3::Z; 3]), uv: Some([Vec2::ZERO, Vec2::X, Vec2::Y]), extras: Extras::default() };
    let (g, _) = push(face, Placement { affine, ..PLAIN });
    let t = g.triangles[0];
    assert_eq!(face_normal([t.v0, t.v1, t.v2].map(Vec3::from)), Some(Vec3::Z));
    assert_eq!((t.v1, g.shading[0].uv1), ([0.0, 1.0, 0.0], [0.0, 1.0]), "corner and coordinate move together");
    let (g, _) = push(face, Placement { flip: true, ..PLAIN });
    let t = g.triangles[0];
    assert_eq!(face_normal([t.v0, t.v1, t.v2].map(Vec3::from)), Some(-Vec3::Z));
}

#[test]
fn what_cannot_be_kept_is_counted() {
    let plain = Corners { p: P, n: None, uv: None, extras: Extras::default() };
    let nan = Corners { p: [Vec3::ZERO, Vec3::NAN, Vec3::Y], ..plain };
    let line = Corners { p: [Vec3::ZERO, Vec3::X, Vec3::X * 2.0], ..plain };
    assert_eq!(push(nan, PLAIN).1, Repairs { not_finite: 1, ..Repairs::default() });
    assert_eq!(push(line, PLAIN).1, Repairs { no_area: 1, ..Repairs::default() });
    assert_eq!(push(plain, PLAIN).1, Repairs { no_normals: 1, ..Repairs::default() });
    assert_eq!(push(plain, Placement { flat: true, ..PLAIN }).1.warning("mesh"), None);
    assert!(push(line, PLAIN).1.warning("mesh").unwrap().contains("1 without area"));
    let zero = Corners { n: Some([Vec3::ZERO; 3]), uv: Some([Vec2::NAN; 3]), ..plain };
    assert_eq!(push(zero, PLAIN).1, Repairs { bad_normals: 1, bad_uvs: 1, ..Repairs::default() });
    let far = Corners { p: P.map(|p| p * 1e19), ..plain };
    let (mut g, mut r) = <(Geometry, Repairs)>::default();
    assert!(g.push(&far, TAG, &PLAIN, &mut r).is_err());
}
#[test]
fn copies_are_dropped_and_what_differs_is_kept() {
    let plain = Corners { p: P, n: None, uv: None, extras: Extras::default() };
    let bent = Corners { n: Some([Vec3::Z, Vec3::Z, Vec3::X]), ..plain };
    let turned = Corners { p: [P[1], P[2], P[0]], ..plain };
    let (mut g, mut r) = <(Geometry, Repairs)>::default();
    let glass = Tag { material: 1, ..TAG };
    let pushed = [(plain, TAG), (plain, TAG), (plain, glass), (bent, TAG), (turned, TAG), (bent, TAG), (plain, TAG)];
    for (primitive, (corners, tag)) in (0..).zip(pushed) {
        g.push(&corners, Tag { primitive, object: primitive, ..tag }, &PLAIN, &mut r).unwrap();
    }
    assert_eq!(g.drop_copies(1), 2, "what lies before the start does not count");
    assert_eq!(g.drop_copies(0), 1);
    let left: Vec<_> = g.triangles.iter().map(|t| t.primitive).collect();
    assert_eq!((left, g.shading.len()), (vec![0, 2, 3, 4], 4));
    assert_eq!((g.shading[1].normal, g.shading[2].normal == FLAT), (FLAT, false));
    let (mut g, mut r) = <(Geometry, Repairs)>::default();
    for (primitive, alpha) in (0..).zip([0.0, 1.0, 0.0]) {
        let extras = Extras { colors: Some([vec4(1.0, 0.5, 0.0, alpha); 3]), ..Extras::default() };
        g.push(&Corners { extras, ..plain }, Tag { primitive, ..TAG }, &PLAIN, &mut r).unwrap();
    }
    assert_eq!(g.drop_copies(0), 1, "one of another colour shows through, or hides the other");
    assert_eq!(g.triangles.iter().map(|t| t.primitive).collect::<Vec<_>>(), [0, 1]);
}
