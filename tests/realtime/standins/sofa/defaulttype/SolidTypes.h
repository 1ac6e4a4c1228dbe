namespace sofa { namespace defaulttype {
template <class Real> struct SolidTypes {
    typedef type::Vec3<Real> Vec3;
    typedef type::Transform<Real> Transform;
    typedef type::SpatialVector<Real> SpatialVector;
};
} }
