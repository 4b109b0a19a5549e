! Transient heat in a box of tetrahedra that may move while it is heated: linear finite elements, lumped mass, explicit steps, each
! rank of MPI with a slab of the box. It knows nothing of Catalyst or Tombolo.
module heat
  use, intrinsic :: iso_c_binding, only: c_double, c_int32_t, c_int64_t
  use mpi
  implicit none
  private :: c_double, c_int32_t, c_int64_t

  type :: heat_solver
    integer :: ranks, rank, size
    integer :: cells, first, slabs, vertices, tets, faces
    ! Of each vertex: x y z, the temperature, the velocity of the mesh.
    real(c_double), allocatable :: coordinates(:, :), temperature(:), velocity(:, :)
    ! Vertices of tetrahedra and of the box's faces, counted from 0 as Catalyst does, and the side (1 to 6) of each face.
    integer(c_int32_t), allocatable :: connectivity(:, :), triangles(:, :), features(:)
    ! Of the vertices in the whole box.
    integer(c_int64_t), allocatable :: numbers(:)
  end type

contains

  integer function begin(self, rank)
    type(heat_solver), intent(in) :: self
    integer, intent(in) :: rank
    begin = int(int(self%cells, c_int64_t) * rank / self%size)
  end function

  ! A unit box, cold but for the side x = 0, which is kept at 1; the side x = 1 is kept at 0.
  subroutine heat_create(self, ranks, cells)
    type(heat_solver), intent(out) :: self
    integer, intent(in) :: ranks, cells
    integer, parameter :: paths(3, 6) = &
      reshape([1, 2, 3, 2, 3, 1, 3, 1, 2, 1, 3, 2, 3, 2, 1, 2, 1, 3], [3, 6])
    integer :: error, side, plane, ends, v, i, j, k, corner, path, edge, axis, end, a, b, low, half, tet, face
    integer :: at(3), step(3), split(3, 2), swapped

    self%ranks = ranks
    self%cells = cells
    call MPI_Comm_rank(ranks, self%rank, error)
    call MPI_Comm_size(ranks, self%size, error)
    self%first = begin(self, self%rank)
    self%slabs = begin(self, self%rank + 1) - self%first
    side = cells + 1
    plane = side * side
    self%vertices = 0
    ends = 0
    if (self%slabs > 0) then
      self%vertices = (self%slabs + 1) * plane
      if (self%first == 0) ends = ends + 1
      if (self%first + self%slabs == cells) ends = ends + 1
    end if
    self%tets = 6 * self%slabs * cells**2
    self%faces = 8 * self%slabs * cells + 2 * ends * cells**2
    allocate (self%coordinates(3, self%vertices), self%temperature(self%vertices), self%velocity(3, self%vertices))
    allocate (self%connectivity(4, self%tets), self%triangles(3, self%faces), self%features(self%faces))
    allocate (self%numbers(self%vertices))

    do v = 0, self%vertices - 1
      at = [self%first + v / plane, mod(v / side, side), mod(v, side)]
      self%coordinates(:, v + 1) = real(at, c_double) / cells
      self%numbers(v + 1) = int(self%first, c_int64_t) * plane + v
      self%temperature(v + 1) = merge(1d0, 0d0, at(1) == 0)
    end do
    self%velocity = 0

    step = [plane, side, 1]
    tet = 0
    face = 0
    do i = 0, self%slabs - 1
      do j = 0, cells - 1
        do k = 0, cells - 1
          corner = i * plane + j * side + k
          ! Along each order of the axes from the lowest corner of the cube to the highest.
          do path = 1, 6
            tet = tet + 1
            self%connectivity(1, tet) = corner
            do edge = 1, 3
              self%connectivity(edge + 1, tet) = self%connectivity(edge, tet) + step(paths(edge, path))
            end do
            if (path > 3) then
              swapped = self%connectivity(2, tet)
              self%connectivity(2, tet) = self%connectivity(3, tet)
              self%connectivity(3, tet) = swapped
            end if
          end do
          at = [self%first + i, j, k]
          do axis = 1, 3
            do end = 0, 1
              if (at(axis) /= end * (cells - 1)) cycle
              a = step(mod(axis, 3) + 1)
              b = step(mod(axis + 1, 3) + 1)
              low = corner + end * step(axis)
              split = reshape([low, low + a, low + a + b, low, low + a + b, low + b], [3, 2])
              do half = 1, 2
                face = face + 1
                ! Seen from outside they run counter-clockwise.
                self%triangles(:, face) = split(:, half)
                if (end == 0) self%triangles(:, face) = split(3:1:-1, half)
                self%features(face) = 2 * axis - 1 + end
              end do
            end do
          end do
        end do
      end do
    end do
  end subroutine

  ! Gradients of the four shape functions of a tetrahedron, and its volume.
  subroutine gradients(self, tet, gradient, volume)
    type(heat_solver), intent(in) :: self
    integer, intent(in) :: tet
    real(c_double), intent(out) :: gradient(3, 4), volume
    real(c_double) :: edge(3, 3), normal(3, 3), six
    integer :: e
    do e = 1, 3
      edge(:, e) = self%coordinates(:, self%connectivity(e + 1, tet) + 1) - self%coordinates(:, self%connectivity(1, tet) + 1)
    end do
    do e = 1, 3
      normal(:, e) = cross(edge(:, mod(e, 3) + 1), edge(:, mod(e + 1, 3) + 1))
    end do
    six = dot_product(edge(:, 1), normal(:, 1))
    gradient(:, 2:4) = normal / six
    gradient(:, 1) = -sum(gradient(:, 2:4), dim=2)
    volume = six / 6
  end subroutine

  pure function cross(a, b)
    real(c_double), intent(in) :: a(3), b(3)
    real(c_double) :: cross(3)
    cross = [a(2) * b(3) - a(3) * b(2), a(3) * b(1) - a(1) * b(3), a(1) * b(2) - a(2) * b(1)]
  end function

  ! Adds what the neighbours have for the planes of vertices that are shared with them. Ranks without slabs are passed over.
  subroutine share(self, values)
    type(heat_solver), intent(in) :: self
    real(c_double), intent(inout) :: values(:)
    real(c_double) :: own((self%cells + 1)**2), received((self%cells + 1)**2)
    integer :: side, other, start, plane, error
    if (self%slabs == 0) return
    plane = (self%cells + 1)**2
    do side = -1, 1, 2
      other = self%rank + side
      do while (other >= 0 .and. other < self%size)
        if (begin(self, other + 1) > begin(self, other)) exit
        other = other + side
      end do
      if (other < 0 .or. other >= self%size) cycle
      start = merge(0, self%slabs * plane, side < 0)
      own = values(start + 1:start + plane)
      call MPI_Sendrecv(own, plane, MPI_DOUBLE_PRECISION, other, 0, received, plane, MPI_DOUBLE_PRECISION, other, 0, &
        self%ranks, MPI_STATUS_IGNORE, error)
      values(start + 1:start + plane) = own + received
    end do
  end subroutine

  ! One step on the mesh as it lies, which moves at `velocity` meanwhile. The caller moves the coordinates.
  subroutine heat_step(self, conductivity, time_step)
    type(heat_solver), intent(inout) :: self
    real(c_double), intent(in) :: conductivity, time_step
    real(c_double) :: gradient(3, 4), volume, own(1), smallest(1)
    integer :: tet, part, parts, error
    ! Explicit steps are stable up to a length that the smallest tetrahedron sets: a step is taken in as many parts as that needs.
    own = 0
    do tet = 1, self%tets
      call gradients(self, tet, gradient, volume)
      own = max(own, sum(gradient**2))
    end do
    call MPI_Allreduce(own, smallest, 1, MPI_DOUBLE_PRECISION, MPI_MAX, self%ranks, error)
    parts = 1 + int(2 * conductivity * time_step * smallest(1))
    do part = 1, parts
      call part_of_step(self, conductivity, time_step / parts)
    end do
  end subroutine

  subroutine part_of_step(self, conductivity, time_step)
    type(heat_solver), intent(inout) :: self
    real(c_double), intent(in) :: conductivity, time_step
    real(c_double) :: mass(self%vertices), rate(self%vertices), gradient(3, 4), slope(3), volume, along
    integer :: tet, c, v, plane, i
    integer :: corners(4)
    mass = 0
    rate = 0
    do tet = 1, self%tets
      call gradients(self, tet, gradient, volume)
      corners = self%connectivity(:, tet) + 1
      slope = matmul(gradient, self%temperature(corners))
      along = dot_product(sum(self%velocity(:, corners), dim=2) / 4, slope)
      do c = 1, 4
        v = corners(c)
        mass(v) = mass(v) + volume / 4
        ! A vertex that moves passes through the temperature: the first term is that of the moving mesh.
        rate(v) = rate(v) + volume * (along / 4 - conductivity * dot_product(gradient(:, c), slope))
      end do
    end do
    call share(self, mass)
    call share(self, rate)
    plane = (self%cells + 1)**2
    do v = 1, self%vertices
      i = self%first + (v - 1) / plane
      if (i > 0 .and. i < self%cells) self%temperature(v) = self%temperature(v) + time_step * rate(v) / mass(v)
    end do
  end subroutine

  ! Volume and mean temperature of the whole box.
  subroutine heat_totals(self, volume, mean)
    type(heat_solver), intent(in) :: self
    real(c_double), intent(out) :: volume, mean
    real(c_double) :: own(2), all(2), gradient(3, 4), part
    integer :: tet, error
    own = 0
    do tet = 1, self%tets
      call gradients(self, tet, gradient, part)
      own = own + part * [1d0, sum(self%temperature(self%connectivity(:, tet) + 1)) / 4]
    end do
    call MPI_Allreduce(own, all, 2, MPI_DOUBLE_PRECISION, MPI_SUM, self%ranks, error)
    volume = all(1)
    mean = all(2) / all(1)
  end subroutine
end module heat
