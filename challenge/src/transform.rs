//! Homogeneous transforms as 4×4 arrays, row-major, that map column vectors.

/// A homogeneous transform.
pub type Transform = [[f64; 4]; 4];
/// A vector or point.
pub type Vector3 = [f64; 3];

/// Identity.
pub const IDENTITY: Transform =
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [0.0, 0.0, 0.0, 1.0]];

/// Product `a b`: first `b`, then `a`.
#[must_use]
pub fn mul(a: &Transform, b: &Transform) -> Transform {
    let mut c = IDENTITY;
    for (row, a) in c.iter_mut().zip(a).take(3) {
        for (k, slot) in row.iter_mut().enumerate() {
            *slot = a[0] * b[0][k] + a[1] * b[1][k] + a[2] * b[2][k] + a[3] * b[3][k];
        }
    }
    c
}

/// Translation.
#[must_use]
pub fn translation(by: Vector3) -> Transform {
    let mut t = IDENTITY;
    for k in 0..3 {
        t[k][3] = by[k];
    }
    t
}

/// Rotation about z, rad.
#[must_use]
pub fn rotation_z(angle: f64) -> Transform {
    let (s, c) = angle.sin_cos();
    let mut t = IDENTITY;
    (t[0][0], t[0][1], t[1][0], t[1][1]) = (c, -s, s, c);
    t
}

/// Rotation about x, rad.
#[must_use]
pub fn rotation_x(angle: f64) -> Transform {
    let (s, c) = angle.sin_cos();
    let mut t = IDENTITY;
    (t[1][1], t[1][2], t[2][1], t[2][2]) = (c, -s, s, c);
    t
}

/// Rotation by a rotation vector, rad, via the unit quaternion.
#[must_use]
pub fn rotation(vector: Vector3) -> Transform {
    let angle = norm(vector);
    let half = if angle < 1e-8 { 0.5 } else { (0.5 * angle).sin() / angle };
    let (w, x, y, z) = ((0.5 * angle).cos(), vector[0] * half, vector[1] * half, vector[2] * half);
    let mut t = IDENTITY;
    t[0][..3].copy_from_slice(&[
        1.0 - 2.0 * (y * y + z * z),
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
    ]);
    t[1][..3].copy_from_slice(&[
        2.0 * (x * y + w * z),
        1.0 - 2.0 * (x * x + z * z),
        2.0 * (y * z - w * x),
    ]);
    t[2][..3].copy_from_slice(&[
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        1.0 - 2.0 * (x * x + y * y),
    ]);
    t
}

/// Inverse transform.
#[must_use]
pub fn inverse(t: &Transform) -> Transform {
    let mut back = IDENTITY;
    for i in 0..3 {
        for (k, row) in t.iter().enumerate().take(3) {
            back[i][k] = row[i];
            back[i][3] -= row[i] * row[3];
        }
    }
    back
}

/// A point transformed.
#[must_use]
pub fn transform_point(t: &Transform, p: Vector3) -> Vector3 {
    add(rotate(t, p), origin(t))
}

/// A vector rotated.
#[must_use]
pub fn rotate(t: &Transform, v: Vector3) -> Vector3 {
    std::array::from_fn(|i| t[i][0] * v[0] + t[i][1] * v[1] + t[i][2] * v[2])
}

/// A vector rotated by the inverse.
#[must_use]
pub fn rotate_inverse(t: &Transform, v: Vector3) -> Vector3 {
    std::array::from_fn(|i| t[0][i] * v[0] + t[1][i] * v[1] + t[2][i] * v[2])
}

/// Translation of a transform.
#[must_use]
pub fn origin(t: &Transform) -> Vector3 {
    [t[0][3], t[1][3], t[2][3]]
}

/// Column `k` of the rotation matrix.
#[must_use]
pub fn column(t: &Transform, k: usize) -> Vector3 {
    [t[0][k], t[1][k], t[2][k]]
}

/// Sum of two vectors.
#[must_use]
pub fn add(a: Vector3, b: Vector3) -> Vector3 {
    std::array::from_fn(|k| a[k] + b[k])
}

/// Difference of two vectors.
#[must_use]
pub fn sub(a: Vector3, b: Vector3) -> Vector3 {
    std::array::from_fn(|k| a[k] - b[k])
}

/// Multiple of a vector.
#[must_use]
pub fn scaled(a: Vector3, factor: f64) -> Vector3 {
    a.map(|x| x * factor)
}

/// Scalar product.
#[must_use]
pub fn dot(a: Vector3, b: Vector3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Cross product.
#[must_use]
pub fn cross(a: Vector3, b: Vector3) -> Vector3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Norm of a vector.
#[must_use]
pub fn norm(a: Vector3) -> f64 {
    dot(a, a).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_turn_keeps_its_axis_and_lengths_and_its_inverse_undoes_it() {
        let t = mul(&translation([0.3, -0.2, 0.9]), &rotation([0.4, -0.7, 0.2]));
        let along = rotate(&t, [0.4, -0.7, 0.2]);
        assert!(norm(sub(along, [0.4, -0.7, 0.2])) < 1e-15);
        let moved = transform_point(&t, [1.0, 2.0, 3.0]);
        assert!(norm(sub(transform_point(&inverse(&t), moved), [1.0, 2.0, 3.0])) < 1e-14);
        let quarter = rotate(&rotation([0.0, 0.0, std::f64::consts::FRAC_PI_2]), [1.0, 0.0, 0.0]);
        assert!(norm(sub(quarter, [0.0, 1.0, 0.0])) < 1e-15, "right-handed");
    }
}
