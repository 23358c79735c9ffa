{{/* What stops floods of HTTP/2, and speaks TLS. In the gateway's pod, as nginx 1.22
     would not hear of gateways that come and go, and keys would pass the network in
     the clear. */}}
{{- define "isomatch.edge" -}}
- name: edge
  image: {{ include "isomatch.image" (dict "root" . "name" "isomatch-edge") }}
  imagePullPolicy: {{ .Values.image.pullPolicy }}
  ports:
    - name: grpc
      containerPort: 8443
  startupProbe:
    tcpSocket:
      port: grpc
    periodSeconds: 2
    failureThreshold: 30
  readinessProbe:
    tcpSocket:
      port: grpc
    periodSeconds: 10
  livenessProbe:
    tcpSocket:
      port: grpc
    periodSeconds: 20
    failureThreshold: 6
  lifecycle:
    preStop:
      sleep:
        seconds: 5
  resources:
    {{- toYaml .Values.edge.resources | nindent 4 }}
  {{- include "isomatch.containerSecurity" . | nindent 2 }}
  volumeMounts:
    - name: edge-tmp
      mountPath: /tmp
    - name: socket
      mountPath: /run/isomatch
    {{- if .Values.tls.secretName }}
    - name: edge
      mountPath: /etc/isomatch-edge/listen.conf
      subPath: listen.conf
      readOnly: true
    - name: tls
      mountPath: /run/secrets/isomatch/tls
      readOnly: true
    {{- end }}
{{- end -}}
